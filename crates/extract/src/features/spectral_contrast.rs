//! `spectral_contrast`: peaks over valleys in octave bands.

use corsmal_dsp::DspError;
use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::frequency::fft_frequencies;
use corsmal_dsp::spectral::{Contrast, ContrastParams};
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, Finish, SlotFn, SlotKernel};
use super::kind::FeatureKind;
use crate::params::{Keys, StftSpec};

/// Parameters of `spectral_contrast`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct SpectralContrast {
    #[serde(flatten)]
    stft: StftSpec,
    fmin: f64,
    n_bands: usize,
    quantile: f64,
    linear: bool,
}

impl Default for SpectralContrast {
    fn default() -> Self {
        let ContrastParams { fmin, n_bands, quantile, linear } = ContrastParams::default();
        Self { stft: StftSpec::default(), fmin, n_bands, quantile, linear }
    }
}

/// Peaks, then valleys, of every band; in decibels unless `linear`.
struct Extremes {
    contrast: Contrast,
    linear: bool,
}

impl SlotKernel for Extremes {
    fn worker(&self) -> SlotFn<'_> {
        let mut scratch = vec![0.0; self.contrast.scratch_len()];
        let Decibel { amin, .. } = Decibel::default();
        Box::new(move |magnitude, out| {
            let (peak, valley) = out.split_at_mut(self.contrast.rows());
            self.contrast.peaks_valleys(magnitude, &mut scratch, peak, valley);
            if !self.linear {
                out.iter_mut().for_each(|x| *x = 10.0 * x.max(amin).log10());
            }
        })
    }
}

/// Peak less valley, each kept within 80 dB of its own maximum over the recording.
struct Difference {
    rows: usize,
    linear: bool,
}

impl Finish for Difference {
    fn peaks(&self) -> Vec<(std::ops::Range<usize>, bool)> {
        if self.linear {
            return Vec::new();
        }
        vec![(0..self.rows, false), (self.rows..2 * self.rows, false)]
    }

    fn without_peaks(&self) -> Option<&'static str> {
        Some("linear to true")
    }

    fn frame(&self, raw: &[f32], peaks: &[f32], channels: usize, out: &mut [f32]) {
        let range = match Decibel::default().top_db {
            Some(range) if !self.linear => range as f32,
            _ => f32::INFINITY,
        };
        let floor = |i: usize| peaks.get(i).map_or(f32::NEG_INFINITY, |top| top - range);
        let (peak, valley) = raw.split_at(self.rows * channels);
        for (i, ((out, peak), valley)) in out.iter_mut().zip(peak).zip(valley).enumerate() {
            let c = i % channels;
            *out = peak.max(floor(c)) - valley.max(floor(channels + c));
        }
    }
}

impl SpectralContrast {
    fn params(&self) -> ContrastParams {
        let Self { fmin, n_bands, quantile, linear, .. } = *self;
        ContrastParams { fmin, n_bands, quantile, linear }
    }
}

impl FeatureKind for SpectralContrast {
    const KIND: &'static str = "spectral_contrast";
    const ABOUT: &'static str = "Mean of the strongest minus mean of the weakest bins in dB \
                                 (linear = true: in magnitudes) of the band below fmin Hz and of \
                                 n_bands octaves above it \
        (librosa.feature.spectral_contrast); the 80 dB range is that of each channel.";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        &[
            ("fmin", "Upper end of the lowest band in Hz; the others are octaves above it."),
            ("n_bands", "Octaves above the lowest band."),
            ("quantile", "Fraction of the bins of a band that form its peak and its valley."),
            ("linear", "true: difference of magnitudes; false: of decibels."),
        ],
    ];
    const PYTHON: &'static str = "feature.spectral_contrast";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let contrast = Contrast::new(&fft_frequencies(sr, stft.n_fft)?, sr, &self.params())?;
        if contrast.lowest_is_empty() {
            let allowed = "so high that at least two bins are below it";
            return Err(DspError::parameter("fmin", self.fmin, allowed));
        }
        let rows = contrast.rows();
        let kernel = Extremes { contrast, linear: self.linear };
        let labels = (0..rows).map(|k| k.to_string()).collect();
        Ok(Feature {
            raw_rows: 2 * rows,
            finish: Some(Box::new(Difference { rows, linear: self.linear })),
            ..Feature::exact(stft, kernel, labels)
        })
    }

    /// At high rates the bands of short transforms hold no bins: what can be checked without the
    /// rate is checked with bins 1 Hz apart.
    fn check(&self) -> corsmal_dsp::Result<()> {
        self.stft.params()?;
        let freqs: Vec<f64> = (0..=384_000).map(f64::from).collect();
        Contrast::new(&freqs, 768_000.0, &self.params()).map(drop)
    }
}
