//! `vggish_patches`: the log-mel patches that VGGish takes (M5).

use corsmal_dsp::DspError;
use corsmal_dsp::corsmal::M5VggishPatches as Plan;
use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::indices;
use crate::params::Keys;

/// `vggish_patches` has no parameters.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct VggishPatches {}

struct Patches(f64);

impl WholeKernel for Patches {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let y = ArrayView2::from_shape((1, y.len()), y).expect("one row");
        let patches = Plan::default().run(y, self.0)?;
        let (count, frames, bands) = patches.dim();
        if count == 0 {
            let needed = (0.975 * self.0).ceil() as usize;
            return Err(DspError::TooShort { name: "y", actual: y.len(), needed });
        }
        let rows = patches.into_shape_with_order((count * frames, bands)).expect("same values");
        Ok(rows.reversed_axes())
    }
}

impl FeatureKind for VggishPatches {
    const KIND: &'static str = "vggish_patches";
    const ABOUT: &'static str = "64 log-mel bands at 16 kHz every 10 ms, ln(mel + 0.01) of magnitudes \
        from 125 to 7500 Hz; every 96 frames are a VGGish patch, a shorter rest is dropped \
        (resamples by itself). Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[];
    const PYTHON: &'static str = "corsmal.m5_vggish_patches";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        Ok(Feature::whole(Extent::Frames(0.01 * sr), Patches(sr), indices(64)))
    }
}
