//! `stft`: the short-time Fourier transform itself.

use corsmal_dsp::lanes::Row;
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, Kernel, Quantity, SpectrumKernel};
use super::kind::FeatureKind;
use super::labels::hertz;
use super::mel_bands::{DecibelFinish, power_rows_to_scale};
use crate::params::{DbSpec, Keys, Scale, StftSpec};

/// What is kept of a complex bin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Output {
    /// Complex numbers (complex64).
    Complex,
    /// `|X|`.
    #[default]
    Magnitude,
    /// `|X|^2`.
    Power,
}

/// Parameters of `stft`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Stft {
    #[serde(flatten)]
    stft: StftSpec,
    output: Output,
    scale: Scale,
    #[serde(flatten)]
    db: DbSpec,
}

struct Copy;

impl SpectrumKernel for Copy {
    fn rows(&self, spectrum: &[Row], out: &mut [Row]) {
        out.copy_from_slice(spectrum);
    }
}

struct Scaled {
    scale: Scale,
    db: corsmal_dsp::decibel::Decibel,
}

impl SpectrumKernel for Scaled {
    fn rows(&self, spectrum: &[Row], out: &mut [Row]) {
        out.copy_from_slice(spectrum);
        power_rows_to_scale(self.scale, &self.db, out);
    }
}

impl FeatureKind for Stft {
    const KIND: &'static str = "stft";
    const ABOUT: &'static str = "Short-time Fourier transform (librosa.stft): one value per \
        frequency bin k at k * sr / n_fft Hz. output = complex, magnitude or power; scale turns \
        magnitude or power into decibels.";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        Scale::KEYS,
        DbSpec::KEYS,
        &[("output", "Part of a complex bin to keep: complex, magnitude or power.")],
    ];
    const PYTHON: &'static str = "stft";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let decibel = self.db.decibel(self.scale)?;
        let bins = stft.n_bins();
        let quantity = match self.output {
            Output::Complex => Quantity::Complex,
            Output::Magnitude => Quantity::Magnitude,
            Output::Power => Quantity::Power,
        };
        let complex = self.output == Output::Complex;
        if complex && self.scale != Scale::Linear {
            let allowed = "linear when the output is complex";
            return Err(corsmal_dsp::DspError::parameter("scale", "decibels", allowed));
        }
        let kernel: Box<dyn SpectrumKernel> = match self.scale {
            Scale::Linear => Box::new(Copy),
            scale => Box::new(Scaled { scale, db: decibel }),
        };
        let n_fft = stft.n_fft as f64;
        let hz = |k: usize| hertz(k as f64 * sr / n_fft);
        let finish = DecibelFinish::of(self.scale, &self.db, bins);
        let kernel = Kernel::Spectrum(stft, quantity, kernel);
        Ok(Feature {
            raw_rows: if complex { 2 * bins } else { bins },
            complex,
            finish,
            ..Feature::new(kernel, (0..bins).map(hz).collect())
        })
    }
}
