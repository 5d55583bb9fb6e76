//! `mfcc`: mel-frequency cepstral coefficients.

use corsmal_dsp::mel::MelNorm;
use corsmal_dsp::mfcc::{DctNorm, MfccParams, mfcc_matrix};
use serde::{Deserialize, Serialize};

use super::mel_bands::{MelKernel, Scale, clamp};
use super::melspectrogram::quantity_of;
use super::{Feature, FeatureKind, Finish, Kernel};
use crate::config::{DbSpec, MelSpec, StftSpec};

/// Parameters of `mfcc`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Mfcc {
    n_mfcc: usize,
    dct_type: u8,
    norm: DctNorm,
    lifter: f64,
    #[serde(flatten)]
    stft: StftSpec,
    power: f64,
    #[serde(flatten)]
    mel: MelSpec,
    mel_norm: MelNorm,
    #[serde(flatten)]
    db: DbSpec,
}

impl Default for Mfcc {
    fn default() -> Self {
        let MfccParams { n_mfcc, dct_type, norm, lifter } = MfccParams::default();
        Self {
            n_mfcc,
            dct_type,
            norm,
            lifter,
            stft: StftSpec::default(),
            power: 2.0,
            mel: MelSpec::default(),
            mel_norm: MelNorm::Slaney,
            db: DbSpec::default(),
        }
    }
}

/// Clamp, then cosine transform.
struct Cepstrum {
    db: DbSpec,
    n_mels: usize,
    /// `[n_mfcc][n_mels]`
    matrix: Vec<f32>,
}

impl Finish for Cepstrum {
    fn peaks(&self) -> Vec<(std::ops::Range<usize>, bool)> {
        vec![(0..self.n_mels, self.db.joint)]
    }

    fn frame(&self, raw: &[f32], peaks: &[f32], channels: usize, out: &mut [f32]) {
        let mut clamped = [0.0_f32; 4096];
        let mut heap = Vec::new();
        let log_mel = match clamped.get_mut(..raw.len()) {
            Some(stack) => stack,
            None => {
                heap.resize(raw.len(), 0.0);
                heap.as_mut_slice()
            }
        };
        clamp(&self.db, raw, peaks, channels, log_mel);
        corsmal_dsp::simd::vectorized(
            #[inline(always)]
            || match channels {
                8 => transform::<8>(&self.matrix, self.n_mels, log_mel, out),
                _ => transform_any(&self.matrix, self.n_mels, channels, log_mel, out),
            },
        );
    }
}

/// `matrix @ log_mel` with `CHANNELS` values side by side.
#[inline(always)]
fn transform<const CHANNELS: usize>(
    matrix: &[f32],
    n_mels: usize,
    log_mel: &[f32],
    out: &mut [f32],
) {
    let log_mel = log_mel.as_chunks::<CHANNELS>().0;
    for (weights, out) in matrix.chunks_exact(n_mels).zip(out.as_chunks_mut::<CHANNELS>().0) {
        let mut sum = [0.0_f32; CHANNELS];
        for (w, x) in weights.iter().zip(log_mel) {
            for (sum, x) in sum.iter_mut().zip(x) {
                *sum += w * x;
            }
        }
        *out = sum;
    }
}

#[inline(always)]
fn transform_any(matrix: &[f32], n_mels: usize, channels: usize, log_mel: &[f32], out: &mut [f32]) {
    for (weights, out) in matrix.chunks_exact(n_mels).zip(out.chunks_exact_mut(channels)) {
        out.fill(0.0);
        for (w, x) in weights.iter().zip(log_mel.chunks_exact(channels)) {
            for (sum, x) in out.iter_mut().zip(x) {
                *sum += w * x;
            }
        }
    }
}

impl FeatureKind for Mfcc {
    const KIND: &'static str = "mfcc";
    const ABOUT: &'static str = "Mel-frequency cepstral coefficients (librosa.feature.mfcc): the \
        first n_mfcc cosine coefficients of the log-mel spectrum in dB; coefficient 0 is the level.";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let params = MfccParams {
            n_mfcc: self.n_mfcc,
            dct_type: self.dct_type,
            norm: self.norm,
            lifter: self.lifter,
        };
        let mel = self.mel.params(sr, stft.n_fft, self.mel_norm);
        let kernel = MelKernel::new(&mel, Scale::PowerToDb, self.db.decibel()?)?;
        let matrix = mfcc_matrix(self.mel.n_mels, &params)?;
        let labels = (0..matrix.nrows()).map(|i| i.to_string()).collect();
        let finish = Cepstrum {
            db: self.db,
            n_mels: self.mel.n_mels,
            matrix: matrix.iter().map(|w| *w as f32).collect(),
        };
        Ok(Feature {
            kernel: Kernel::Spectrum(stft, quantity_of(self.power)?, Box::new(kernel)),
            raw_rows: self.mel.n_mels,
            labels,
            complex: false,
            finish: Some(Box::new(finish)),
        })
    }
}
