//! `m4_logmel`: the input of M4 (HVRL).

use corsmal_dsp::corsmal::{M4LogMel as Plan, M4Plan, Variant};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::indices;
use crate::params::Keys;

/// Parameters of `m4_logmel`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct M4LogMel {
    variant: Variant,
}

impl WholeKernel for M4Plan {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let bands = M4Plan::interleaved(self, y, 1)?;
        let frames = Array2::from_shape_vec((self.frames(y.len()), 64), bands);
        Ok(frames.expect("one channel").reversed_axes())
    }

    fn interleaved(
        &self,
        samples: &[f32],
        channels: usize,
    ) -> Option<corsmal_dsp::Result<Vec<f32>>> {
        Some(M4Plan::interleaved(self, samples, channels))
    }
}

impl FeatureKind for M4LogMel {
    const KIND: &'static str = "m4_logmel";
    const ABOUT: &'static str = "64 mel bands in dB of 25 ms frames every 10 ms on 16-bit counts (M4's \
        input): variant = code truncates frames to 512 samples and doubles the decibels, variant = \
        paper does not. Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[&[(
        "variant",
        "code: as the released program computes it; paper: as the paper describes it.",
    )]];
    const PYTHON: &'static str = "corsmal.m4_logmel";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let step = (0.01 * sr).round_ties_even();
        let bands = Plan { variant: self.variant }.plan(sr)?;
        Ok(Feature::whole(Extent::Frames(step), bands, indices(64)))
    }
}
