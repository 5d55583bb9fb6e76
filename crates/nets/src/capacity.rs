//! M2's estimate of a container's capacity from the depth of its region.

use std::path::Path;

use crate::error::{NetError, Result};
use crate::network::Network;
use crate::networks;
use crate::weights::{self, WeightsError};

/// The network's output is the capacity over this many mL.
const LARGEST_ML: f64 = 4000.0;
/// Side of its input in px.
const SIDE: usize = 112;

/// M2's network with its weights.
#[derive(Debug)]
pub struct CapacityNetwork(Network);

impl CapacityNetwork {
    /// Reads the published weights, or others under the same names: `.pth`, `.npz`, `.safetensors`.
    ///
    /// # Errors
    /// [`WeightsError`] for files that cannot be read or hold another network's weights.
    pub fn read(path: &Path) -> std::result::Result<Self, WeightsError> {
        let state = weights::read(path)?;
        let refuse = |e: NetError| WeightsError::Content {
            path: path.into(),
            reason: format!("not the weights of M2's capacity network: {e}"),
        };
        let mut network =
            networks::named("m2_capacity").and_then(|d| d.build(None, 0)).map_err(refuse)?;
        network.load_state(&state).map_err(refuse)?;
        Ok(Self(network))
    }

    /// Capacity in mL. `depth` is the region's depth over 700 mm, resized to 112 by 112, row by row; `size` its
    /// height over 720 px and width over 1280 px.
    ///
    /// # Errors
    /// [`NetError`] for another number of values, or values that are not finite.
    pub fn millilitres(&self, depth: &[f32], size: [f32; 2]) -> Result<f64> {
        let depth = (vec![1, 1, SIDE, SIDE], depth.to_vec());
        let inputs = self.0.batches(&[depth, (vec![1, 2], size.to_vec())])?;
        let outputs = self.0.forward(&inputs)?;
        Ok(outputs.values.values().iter().map(|&y| f64::from(y) * LARGEST_ML).sum())
    }
}
