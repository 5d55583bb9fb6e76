//! Where recordings and detections are, and how faithfully a method is followed.

use std::path::PathBuf;

use clap::ValueEnum;
use corsmal_ccm::capacity::{CapacityOptions, Method};
use corsmal_vision::cuboid::Outliers;
use corsmal_vision::lode::Variant;

use crate::args::Jobs;

/// The seed, unless one is given.
pub(super) const SEED: u64 = 1;

/// Where recordings and detections are.
#[derive(clap::Args)]
pub(super) struct Source {
    /// Folder of the data set.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder of tables of detections (SEQUENCE.csv or .json, by container or not); by default
    /// `detections/` next to each recording's audio folder.
    #[arg(long, value_name = "DIR")]
    pub(super) detections: Option<PathBuf>,
    /// Seed of votes (m3, fused), isolation forests (m4, fused) and the training of m2's network
    /// [default: 1]
    #[arg(long)]
    pub(super) seed: Option<u64>,
    #[command(flatten)]
    pub(super) jobs: Jobs,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum VariantName {
    /// As the published program computes it, including its quirks.
    Published,
    /// Without its defects.
    Corrected,
}

impl Source {
    pub(super) fn options(self, method: Method, variant: VariantName) -> CapacityOptions {
        let published = variant == VariantName::Published;
        CapacityOptions {
            data: self.data,
            detections: self.detections,
            method,
            variant: if published { Variant::Published } else { Variant::Corrected },
            outliers: if published { Outliers::Published } else { Outliers::Corrected },
            model: None,
            network: None,
            jobs: self.jobs.count(),
            seed: self.seed.unwrap_or(SEED),
        }
    }
}

/// The containers that a model's provenance names.
pub(super) fn learned_containers(provenance: &serde_json::Value) -> Vec<u8> {
    let containers = provenance["containers"].as_array().into_iter().flatten();
    containers.filter_map(|n| n.as_u64()?.try_into().ok()).collect()
}
