//! M2's network.

use std::path::Path;
use std::sync::Arc;

use corsmal_ccm::capacity::RegionNetwork;

use crate::failure::Failure;

/// The network with the weights of a file.
#[cfg(feature = "nets")]
pub(super) fn read(weights: Option<&Path>) -> Result<Arc<dyn RegionNetwork>, Failure> {
    use corsmal_nets::capacity::CapacityNetwork;
    use corsmal_vision::region::Region;

    #[derive(Debug)]
    struct Published(CapacityNetwork, String);

    impl RegionNetwork for Published {
        fn capacity_ml(&self, region: &Region) -> Result<f64, String> {
            self.0.millilitres(&region.image, region.size).map_err(|e| e.to_string())
        }

        fn identity(&self) -> &str {
            &self.1
        }
    }

    let weights = weights.ok_or_else(|| {
        Failure::new(
            "--method m2 needs --weights: the published file of M2's capacity network (.pth, .npz or .safetensors)",
        )
    })?;
    let network = CapacityNetwork::read(weights).map_err(|e| Failure::new(e.to_string()))?;
    let identity = corsmal_files::identity::of_file(weights)
        .map_err(|e| Failure::new(format!("{}: {e}", weights.display())))?;
    Ok(Arc::new(Published(network, identity)))
}

/// There is none in this program.
#[cfg(not(feature = "nets"))]
pub(super) fn read(_: Option<&Path>) -> Result<Arc<dyn RegionNetwork>, Failure> {
    Err(Failure::new(
        "--method m2 runs a network, and this program was built without the feature 'nets'",
    ))
}
