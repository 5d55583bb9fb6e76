//! `spectral_flatness`: how noise-like a spectrum is.

use corsmal_dsp::spectral::Flatness;
use serde::{Deserialize, Serialize};

use super::{Feature, FeatureKind, SlotFn, SlotKernel};
use crate::config::StftSpec;

/// Parameters of `spectral_flatness`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct SpectralFlatness {
    #[serde(flatten)]
    stft: StftSpec,
    amin: f64,
    power: f64,
}

impl Default for SpectralFlatness {
    fn default() -> Self {
        let Flatness { amin, power } = Flatness::default();
        Self { stft: StftSpec::default(), amin, power }
    }
}

struct Means(Flatness);

impl SlotKernel for Means {
    fn worker(&self) -> SlotFn<'_> {
        Box::new(|magnitude, out| out[0] = f64::from(self.0.of(magnitude)))
    }
}

impl FeatureKind for SpectralFlatness {
    const KIND: &'static str = "spectral_flatness";
    const ABOUT: &'static str = "Geometric over arithmetic mean of the powers \
        (librosa.feature.spectral_flatness): 1 for white noise and silence, towards 0 for tones.";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let params = Flatness { amin: self.amin, power: self.power };
        params.check()?;
        Ok(Feature::exact(stft, Box::new(Means(params)), vec![String::new()]))
    }
}
