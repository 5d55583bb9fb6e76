//! `m2_mfcc`: the input of M2 (NTNU-ERC).

use corsmal_dsp::corsmal::M2Mfcc as Plan;
use corsmal_dsp::librosa::LibrosaVersion;
use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::indices;
use crate::params::{Keys, LIBROSA};

/// Parameters of `m2_mfcc`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct M2Mfcc {
    librosa: LibrosaVersion,
    /// Zero frames up to the network's 1501.
    padded: bool,
}

impl Default for M2Mfcc {
    fn default() -> Self {
        let Plan { librosa, padded } = Plan::default();
        Self { librosa, padded }
    }
}

struct Cepstra(Plan, f64);

impl WholeKernel for Cepstra {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let y = ArrayView2::from_shape((1, y.len()), y).expect("one row");
        Ok(self.0.run(y, self.1)?.reversed_axes())
    }
}

impl FeatureKind for M2Mfcc {
    const KIND: &'static str = "m2_mfcc";
    const ABOUT: &'static str = "40 MFCC of the first 30 s at 22,050 Hz every 20 ms, standardised \
        over the recording, with zero frames up to 1501 (M2's input; resamples by itself). Holds \
        the whole recording in memory.";
    const KEYS: &'static [Keys] =
        &[LIBROSA, &[("padded", "true: zero frames up to the network's 1501.")]];
    const PYTHON: &'static str = "corsmal.m2_mfcc";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let plan = Plan { librosa: self.librosa, padded: self.padded };
        Ok(Feature::whole(Extent::Frames(sr * 441.0 / 22_050.0), Cepstra(plan, sr), indices(40)))
    }
}
