//! `m4_logmel`: the input of M4 (HVRL).

use corsmal_dsp::DspError;
use corsmal_dsp::corsmal::{M4LogMel as Plan, Variant};
use ndarray::{Array2, ArrayView2, Axis};
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

struct Bands(Plan, f64);

impl WholeKernel for Bands {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let y = ArrayView2::from_shape((1, y.len()), y).expect("one row");
        Ok(self.0.run(y, self.1)?.index_axis_move(Axis(2), 0).reversed_axes())
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
        if step < 1.0 {
            return Err(DspError::parameter("sr", sr, "at least 100 Hz"));
        }
        let bands = Bands(Plan { variant: self.variant }, sr);
        Ok(Feature::whole(Extent::Frames(step), bands, indices(64)))
    }
}
