//! `spectral_flatness`: how noise-like a spectrum is.

use corsmal_dsp::DspError;
use corsmal_dsp::spectral::Flatness;
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, SlotFn, SlotKernel};
use super::kind::FeatureKind;
use crate::params::{Keys, StftSpec};

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
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        &[
            ("amin", "Smallest power distinguished from zero."),
            ("power", "Exponent of the magnitudes; 2 is power."),
        ],
    ];
    const PYTHON: &'static str = "feature.spectral_flatness";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let params = Flatness { amin: self.amin, power: self.power };
        params.check()?;
        if self.amin < f64::from(f32::MIN_POSITIVE) {
            return Err(DspError::parameter(
                "amin",
                self.amin,
                "at least 1.2e-38, since features are single precision",
            ));
        }
        Ok(Feature::exact(stft, Means(params), vec![String::new()]))
    }
}
