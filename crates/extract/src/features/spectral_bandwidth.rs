//! `spectral_bandwidth`: the spread of a spectrum around its centroid.

use corsmal_dsp::frequency::fft_frequencies;
use corsmal_dsp::spectral::{Bandwidth, centroid};
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, SlotFn, SlotKernel};
use super::kind::FeatureKind;
use crate::params::{Keys, StftSpec};

/// Parameters of `spectral_bandwidth`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct SpectralBandwidth {
    #[serde(flatten)]
    stft: StftSpec,
    norm: bool,
    p: f64,
}

impl Default for SpectralBandwidth {
    fn default() -> Self {
        let Bandwidth { p, norm } = Bandwidth::default();
        Self { stft: StftSpec::default(), norm, p }
    }
}

struct Spread {
    freqs: Vec<f64>,
    params: Bandwidth,
}

impl SlotKernel for Spread {
    fn worker(&self) -> SlotFn<'_> {
        Box::new(|magnitude, out| {
            let middle = centroid(magnitude, &self.freqs);
            out[0] = self.params.of(magnitude, &self.freqs, middle);
        })
    }
}

impl FeatureKind for SpectralBandwidth {
    const KIND: &'static str = "spectral_bandwidth";
    const ABOUT: &'static str = "Spread in Hz around the centroid: the p-th root of the p-th \
        moment (librosa.feature.spectral_bandwidth); p = 2 is a standard deviation.";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        &[
            ("norm", "true: magnitudes are divided by their sum first."),
            ("p", "Exponent of the distance from the centroid; 2 gives a standard deviation."),
        ],
    ];
    const PYTHON: &'static str = "feature.spectral_bandwidth";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let params = Bandwidth { p: self.p, norm: self.norm };
        params.check()?;
        let kernel = Spread { freqs: fft_frequencies(sr, stft.n_fft)?, params };
        Ok(Feature::exact(stft, kernel, vec![String::new()]))
    }
}
