//! `spec9216`: the spectrogram image of the CORSMAL baselines.

use corsmal_dsp::corsmal::Spec9216 as Image;
use corsmal_dsp::stft::PadMode;
use ndarray::{Array2, ArrayView1};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::pixels;
use crate::params::{Keys, at_most};

/// Longest signal, 25 minutes at 44.1 kHz; bounds the memory of the spectrogram.
const MAX_LENGTH: usize = 1 << 26;

/// Parameters of `spec9216`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Spec9216 {
    /// Samples to cut or zero-pad to; 0 keeps the length.
    fixed_len: usize,
    pad_mode: PadMode,
}

impl Default for Spec9216 {
    fn default() -> Self {
        Self { fixed_len: 220_500, pad_mode: PadMode::Constant }
    }
}

impl WholeKernel for Image {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let image = self.run(ArrayView1::from(y))?;
        Ok(Array2::from_shape_vec((image.len(), 1), image.iter().map(|x| *x as f32).collect())
            .expect("one column"))
    }
}

impl FeatureKind for Spec9216 {
    const KIND: &'static str = "spec9216";
    const ABOUT: &'static str = "Decibel spectrogram (512-point transform, hop 128) of the channel \
        divided by its RMS and cut or zero-padded to fixed_len samples, as an image of 96 x 96, row \
        by row from 0 Hz. Silence is refused; holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[&[
        ("fixed_len", "Samples to cut or zero-pad to; 0: keep the length of the recording."),
        ("pad_mode", "Padding beyond the ends: constant (zeros), edge, reflect or symmetric."),
    ]];
    const PYTHON: &'static str = "corsmal.spec9216";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        at_most("fixed_len", self.fixed_len, MAX_LENGTH)?;
        let fixed_len = (self.fixed_len > 0).then_some(self.fixed_len);
        let image = Image { fixed_len, pad_mode: self.pad_mode };
        Ok(Feature::whole(Extent::Vector, image, pixels()))
    }
}
