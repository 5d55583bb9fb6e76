//! `poly_features`: a polynomial fitted to a spectrum.

use corsmal_dsp::frequency::fft_frequencies;
use corsmal_dsp::spectral::Poly;
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, SlotFn, SlotKernel};
use super::kind::FeatureKind;
use crate::params::{Keys, StftSpec};

/// Parameters of `poly_features`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct PolyFeatures {
    #[serde(flatten)]
    stft: StftSpec,
    order: usize,
}

impl Default for PolyFeatures {
    fn default() -> Self {
        Self { stft: StftSpec::default(), order: 1 }
    }
}

impl SlotKernel for Poly {
    fn worker(&self) -> SlotFn<'_> {
        Box::new(|magnitude, out| self.fit(magnitude, out))
    }
}

impl FeatureKind for PolyFeatures {
    const KIND: &'static str = "poly_features";
    const ABOUT: &'static str = "Coefficients, highest degree first, of the polynomial of that order \
        in the frequency in Hz fitted to the magnitudes (librosa.feature.poly_features).";
    const KEYS: &'static [Keys] = &[StftSpec::KEYS, &[("order", "Degree of the polynomial.")]];
    const PYTHON: &'static str = "feature.poly_features";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let poly = Poly::new(&fft_frequencies(sr, stft.n_fft)?, self.order)?;
        let labels = (0..=self.order).rev().map(|degree| format!("f^{degree}")).collect();
        Ok(Feature::exact(stft, poly, labels))
    }
}
