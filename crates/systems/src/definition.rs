//! What a system is.

use std::path::PathBuf;
use std::sync::Arc;

use corsmal_ccm::benchmark::System;
use corsmal_nets::device::Device;

use crate::training::Weights;

/// What is chosen for all networks of all systems.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Epochs instead of the published ones.
    pub epochs: Option<usize>,
    /// Embeddings of recordings by other programs, by name (`vggish`, `r21d`), in the format of
    /// [`corsmal_nets::dataset`]; several files of a name are joined.
    pub embeddings: Vec<(String, PathBuf)>,
    /// Weights that networks begin with instead of random ones, by name.
    pub weights: Vec<(String, Arc<Weights>)>,
    /// Where networks compute.
    pub device: Device,
}

/// A system of the paper.
pub struct Definition {
    /// Name on the command line.
    pub name: &'static str,
    /// One sentence.
    pub about: &'static str,
    /// Networks that it is made of.
    pub networks: &'static [&'static str],
    /// What of it is not there, or is a choice of ours, in sentences.
    pub limits: &'static [&'static str],
    /// Makes it.
    pub(crate) make: fn(Settings) -> Box<dyn System>,
}

impl Definition {
    /// The system, ready to be run.
    pub fn make(&self, settings: &Settings) -> Box<dyn System> {
        (self.make)(settings.clone())
    }
}
