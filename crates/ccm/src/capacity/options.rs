//! What to estimate, and how.

use std::path::PathBuf;
use std::sync::Arc;

use corsmal_vision::cuboid::Outliers;
use corsmal_vision::lode::Variant;

use super::methods::RegionNetwork;
use super::model::CapacityModel;

/// A method of the paper, or the fused estimate beyond it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// A network on a region of interest in the depth of the robot's view.
    M2,
    /// Gaussian processes on the sizes of detected regions.
    M3,
    /// Cuboid around the points of one depth image.
    M4,
    /// LoDE in two views.
    M5,
    /// All that there is, by measured reliability.
    Fused,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 5] = [Self::M2, Self::M3, Self::M4, Self::M5, Self::Fused];

    /// Whether it takes a model that was trained on containers.
    pub fn learns(self) -> bool {
        matches!(self, Self::M2 | Self::M3 | Self::Fused)
    }

    /// Name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::M2 => "m2",
            Self::M3 => "m3",
            Self::M4 => "m4",
            Self::M5 => "m5",
            Self::Fused => "fused",
        }
    }
}

/// What to estimate, and how.
#[derive(Clone, Debug)]
pub struct CapacityOptions {
    /// Folder of the data set.
    pub data: PathBuf,
    /// Folder of tables of detections; `None` for those beside the recordings.
    pub detections: Option<PathBuf>,
    /// The method.
    pub method: Method,
    /// How faithfully M2's search and LoDE are followed.
    pub variant: Variant,
    /// How M4's outliers are dropped.
    pub outliers: Outliers,
    /// What M3 and the fused estimate have learned.
    pub model: Option<CapacityModel>,
    /// M2's network.
    pub network: Option<Arc<dyn RegionNetwork>>,
    /// Recordings at a time.
    pub jobs: usize,
    /// Seed of votes and forests.
    pub seed: u64,
}

impl CapacityOptions {
    /// Hash of everything that decides about an estimate, apart from the recordings: method, variants, seed, and
    /// the content of a model or of weights where the method takes them.
    pub fn config_hash(&self) -> String {
        let learned = matches!(self.method, Method::M3 | Method::Fused);
        let network = (self.method == Method::M2).then_some(self.network.as_ref()).flatten();
        let config = serde_json::json!({
            "method": self.method.name(),
            "variant": format!("{:?}", self.variant),
            "outliers": format!("{:?}", self.outliers),
            "seed": self.seed,
            "model": self.model.as_ref().filter(|_| learned),
            "weights": network.map(|network| network.identity()),
        });
        blake3::hash(config.to_string().as_bytes()).to_hex().to_string()
    }
}
