//! `spectral_centroid`: the mean frequency of a spectrum.

use corsmal_dsp::frequency::fft_frequencies;
use corsmal_dsp::spectral::centroid;
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, SlotFn, SlotKernel};
use super::kind::FeatureKind;
use crate::params::{Keys, StftSpec};

/// Parameters of `spectral_centroid`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SpectralCentroid {
    #[serde(flatten)]
    stft: StftSpec,
}

struct Centroid(Vec<f64>);

impl SlotKernel for Centroid {
    fn worker(&self) -> SlotFn<'_> {
        Box::new(|magnitude, out| out[0] = centroid(magnitude, &self.0))
    }
}

impl FeatureKind for SpectralCentroid {
    const KIND: &'static str = "spectral_centroid";
    const ABOUT: &'static str = "Mean frequency in Hz weighted by magnitudes \
        (librosa.feature.spectral_centroid); 0 for silence.";
    const KEYS: &'static [Keys] = &[StftSpec::KEYS];
    const PYTHON: &'static str = "feature.spectral_centroid";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let kernel = Centroid(fft_frequencies(sr, stft.n_fft)?);
        Ok(Feature::exact(stft, kernel, vec![String::new()]))
    }
}
