//! `mfcc`: mel-frequency cepstral coefficients.

use corsmal_dsp::DspError;
use corsmal_dsp::mel::MelNorm;
use corsmal_dsp::mfcc::{DctNorm, MfccParams, mfcc_matrix};
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, Finish, Kernel};
use super::kind::FeatureKind;
use super::mel_bands::{MelKernel, clamp};
use super::melspectrogram::quantity_of;
use crate::params::{DbSpec, Keys, MelSpec, Scale, StftSpec};

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

/// Coefficients of a single channel that are summed together.
const TOGETHER: usize = 16;

/// Clamp, then cosine transform.
struct Cepstrum {
    db: DbSpec,
    n_mels: usize,
    /// `[n_mfcc][n_mels]`
    matrix: Vec<f32>,
    /// The same as `[n_mfcc / 16][n_mels][16]`, filled up with zeros.
    columns: Vec<[f32; TOGETHER]>,
}

impl Cepstrum {
    fn new(db: DbSpec, n_mels: usize, matrix: Vec<f32>) -> Self {
        let columns = matrix
            .chunks(TOGETHER * n_mels)
            .flat_map(|rows| {
                let weight = move |k: usize, m: usize| rows.get(k * n_mels + m).copied();
                (0..n_mels).map(move |m| std::array::from_fn(|k| weight(k, m).unwrap_or_default()))
            })
            .collect();
        Self { db, n_mels, matrix, columns }
    }

    /// Eight channels side by side, two coefficients at a time so that sums need not wait for each
    /// other.
    #[inline(always)]
    fn of_eight(&self, log_mel: &[f32], out: &mut [f32]) {
        let log_mel = log_mel.as_chunks::<8>().0;
        let rows = self.matrix.chunks(2 * self.n_mels);
        for (rows, out) in rows.zip(out.as_chunks_mut::<8>().0.chunks_mut(2)) {
            let (first, second) = rows.split_at(self.n_mels);
            if let [a, b] = out {
                let (mut sum, mut other) = ([0.0; 8], [0.0; 8]);
                for ((v, w), x) in first.iter().zip(second).zip(log_mel) {
                    for c in 0..8 {
                        sum[c] += v * x[c];
                    }
                    for c in 0..8 {
                        other[c] += w * x[c];
                    }
                }
                (*a, *b) = (sum, other);
            } else if let [last] = out {
                let mut sum = [0.0; 8];
                for (w, x) in first.iter().zip(log_mel) {
                    for c in 0..8 {
                        sum[c] += w * x[c];
                    }
                }
                *last = sum;
            }
        }
    }

    /// Any number of channels, one after the other.
    #[inline(always)]
    fn of_each(&self, channels: usize, log_mel: &[f32], out: &mut [f32]) {
        for c in 0..channels {
            let columns = self.columns.chunks_exact(self.n_mels);
            for (columns, out) in columns.zip(out.chunks_mut(TOGETHER * channels)) {
                let mut sums = [0.0_f32; TOGETHER];
                for (weights, x) in columns.iter().zip(log_mel[c..].iter().step_by(channels)) {
                    for (sum, w) in sums.iter_mut().zip(weights) {
                        *sum += w * x;
                    }
                }
                for (out, sum) in out[c..].iter_mut().step_by(channels).zip(sums) {
                    *out = sum;
                }
            }
        }
    }
}

impl Finish for Cepstrum {
    fn peaks(&self) -> Vec<(std::ops::Range<usize>, bool)> {
        vec![(0..self.n_mels, self.db.joint)]
    }

    fn needs_peaks(&self) -> bool {
        self.db.needs_peak()
    }

    fn without_peaks(&self) -> Option<&'static str> {
        Some(DbSpec::WITHOUT_PEAK)
    }

    fn frame(&self, raw: &[f32], peaks: &[f32], channels: usize, out: &mut [f32]) {
        let mut clamped = [0.0_f32; 1024];
        let mut heap = Vec::new();
        let log_mel = match clamped.get_mut(..raw.len()) {
            Some(stack) => stack,
            None => {
                heap.resize(raw.len(), 0.0);
                heap.as_mut_slice()
            }
        };
        corsmal_dsp::simd::vectorized(
            #[inline(always)]
            || {
                clamp(&self.db, raw, peaks, channels, log_mel);
                match channels {
                    8 => self.of_eight(log_mel, out),
                    _ => self.of_each(channels, log_mel, out),
                }
            },
        );
    }
}

impl FeatureKind for Mfcc {
    const KIND: &'static str = "mfcc";
    const ABOUT: &'static str = "Mel-frequency cepstral coefficients (librosa.feature.mfcc): the \
        first n_mfcc cosine coefficients of the log-mel spectrum in dB; coefficient 0 is the level.";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        MelSpec::KEYS,
        DbSpec::KEYS,
        &[
            ("n_mfcc", "Number of coefficients, starting with 0 (the level)."),
            ("dct_type", "Type of the cosine transform: 1, 2 or 3."),
            ("norm", "Norm of the cosine transform: ortho or none."),
            (
                "lifter",
                "Coefficient n is weighted by 1 + lifter / 2 * sin(pi * (n + 1) / lifter); 0: no weights.",
            ),
            ("power", "Exponent of the magnitudes before the bands: 2 is power, 1 magnitude."),
            (
                "mel_norm",
                "Weight of the bands: slaney (equal area), none, or a number p for the p-norm.",
            ),
        ],
    ];
    const PYTHON: &'static str = "feature.mfcc";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let params = MfccParams {
            n_mfcc: self.n_mfcc,
            dct_type: self.dct_type,
            norm: self.norm,
            lifter: self.lifter,
        };
        let mel = self.mel.params(sr, stft.n_fft, self.mel_norm);
        let kernel = MelKernel::new(&mel, Scale::PowerToDb, self.db.decibel(Scale::PowerToDb)?)?;
        if self.n_mfcc > self.mel.n_mels {
            let allowed = format!("at most n_mels ({})", self.mel.n_mels);
            return Err(DspError::parameter("n_mfcc", self.n_mfcc, allowed));
        }
        let matrix = mfcc_matrix(self.mel.n_mels, &params)?;
        let labels = (0..matrix.nrows()).map(|i| i.to_string()).collect();
        let weights = matrix.iter().map(|w| *w as f32).collect();
        let finish = Cepstrum::new(self.db, self.mel.n_mels, weights);
        let kernel = Kernel::Spectrum(stft, quantity_of(self.power)?, Box::new(kernel));
        Ok(Feature {
            raw_rows: self.mel.n_mels,
            finish: Some(Box::new(finish)),
            ..Feature::new(kernel, labels)
        })
    }
}
