//! `m3_spectrogram`: the input of M3 (Concatenation).

use corsmal_dsp::corsmal::M3Spectrogram as Plan;
use corsmal_dsp::stft::StftParams;
use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::indices;
use crate::params::{Keys, MAX_N_FFT, at_most};

/// Parameters of `m3_spectrogram`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct M3Spectrogram {
    n_fft: usize,
    hop_length: usize,
}

impl Default for M3Spectrogram {
    fn default() -> Self {
        let Plan { n_fft, hop_length } = Plan::default();
        Self { n_fft, hop_length }
    }
}

struct Magnitudes(Plan, f64);

impl WholeKernel for Magnitudes {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        self.0.run(ArrayView2::from_shape((1, y.len()), y).expect("one row"), self.1)
    }

    fn unread(&self, frames: u64) -> u64 {
        self.0.unread(self.1, frames).unwrap_or(0)
    }
}

impl FeatureKind for M3Spectrogram {
    const KIND: &'static str = "m3_spectrogram";
    const ABOUT: &'static str = "Magnitude spectrogram of the last 32,000 samples at 16,600 Hz (M3's \
        input; resamples by itself); times count from the first of these samples. Holds the whole \
        recording in memory.";
    const KEYS: &'static [Keys] = &[&[
        ("n_fft", "Samples per transform."),
        ("hop_length", "Samples from one frame to the next, at 16,600 Hz."),
    ]];
    const PYTHON: &'static str = "corsmal.m3_spectrogram";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let params = StftParams::new(self.n_fft, self.hop_length);
        params.check()?;
        at_most("n_fft", self.n_fft, MAX_N_FFT)?;
        let plan = Plan { n_fft: self.n_fft, hop_length: self.hop_length };
        let extent = Extent::Frames(sr * self.hop_length as f64 / 16_600.0);
        Ok(Feature::whole(extent, Magnitudes(plan, sr), indices(params.n_bins())))
    }
}
