//! `spectral_rolloff`: the frequency below which most of a spectrum lies.

use corsmal_dsp::DspError;
use corsmal_dsp::frequency::fft_frequencies;
use corsmal_dsp::spectral::rolloff;
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, SlotFn, SlotKernel};
use super::kind::FeatureKind;
use crate::params::{Keys, StftSpec};

/// Parameters of `spectral_rolloff`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct SpectralRolloff {
    #[serde(flatten)]
    stft: StftSpec,
    roll_percent: f64,
}

impl Default for SpectralRolloff {
    fn default() -> Self {
        Self { stft: StftSpec::default(), roll_percent: 0.85 }
    }
}

struct Rolloff {
    freqs: Vec<f64>,
    roll_percent: f64,
}

impl SlotKernel for Rolloff {
    fn worker(&self) -> SlotFn<'_> {
        let mut sums = Vec::new();
        Box::new(move |magnitude, out| {
            out[0] = rolloff(magnitude, &self.freqs, self.roll_percent, &mut sums);
        })
    }
}

impl FeatureKind for SpectralRolloff {
    const KIND: &'static str = "spectral_rolloff";
    const ABOUT: &'static str = "Lowest bin frequency in Hz such that the fraction roll_percent \
                                 of the magnitudes is at or below \
                                 it (librosa.feature.spectral_rolloff).";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        &[(
            "roll_percent",
            "Fraction of the sum of magnitudes at or below the result, between 0 and 1.",
        )],
    ];
    const PYTHON: &'static str = "feature.spectral_rolloff";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let roll_percent = self.roll_percent;
        if !(roll_percent > 0.0 && roll_percent < 1.0) {
            return Err(DspError::parameter("roll_percent", roll_percent, "between 0 and 1"));
        }
        let kernel = Rolloff { freqs: fft_frequencies(sr, stft.n_fft)?, roll_percent };
        Ok(Feature::exact(stft, kernel, vec![String::new()]))
    }
}
