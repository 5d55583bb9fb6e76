//! pyAudioAnalysis 0.3.14: 34 short-term features, their deltas, and mid-term statistics.
//!
//! Reproduced with every quirk, since published models were trained on them: a recording is divided
//! by 32768 whatever its scale, centred and peak-normalised as a whole; frames are not windowed; the
//! mel filters sit at half their frequency; most chroma bins are overwritten. All in double
//! precision. Everything that depends on the rate and the window only is made once per [`PaaPlan`].

mod level;
mod midterm;
mod tables;

use std::sync::Arc;

use ndarray::{Array2, ArrayView1};
use num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};
use crate::frequency::require_rate;
use crate::real::{Real, require_finite};
use crate::simd::vectorized;
use crate::sums::{extremes, sum, sum_pairs};
use level::Level;
use tables::{ChromaBin, Filter, N_CHROMA, N_MFCC};

pub use midterm::{MidTerm, file_vector};
pub use tables::paa_fbank;

/// Short-term features per frame.
pub const N_SHORT: usize = 34;
const EPS: f64 = f64::EPSILON;
const BLOCKS: usize = 10;

/// Names of the 34 features in order, as pyAudioAnalysis gives them.
pub fn short_names() -> Vec<String> {
    let mut names: Vec<String> = [
        "zcr",
        "energy",
        "energy_entropy",
        "spectral_centroid",
        "spectral_spread",
        "spectral_entropy",
        "spectral_flux",
        "spectral_rolloff",
    ]
    .map(String::from)
    .to_vec();
    names.extend((1..=N_MFCC).map(|i| format!("mfcc_{i}")));
    names.extend((1..=N_CHROMA).map(|i| format!("chroma_{i}")));
    names.push("chroma_std".into());
    names
}

/// The largest magnitude that a recording is divided by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Peak {
    /// Of the centred recording (version 0.3.14).
    #[default]
    Centred,
    /// Of the recording as it came, which versions of early 2020 took.
    Raw,
}

/// Tables for one sample rate, window and step (in samples).
#[derive(Clone)]
pub struct PaaPlan {
    sr: f64,
    window: usize,
    step: usize,
    peak: Peak,
    fft: Arc<dyn Fft<f64>>,
    /// Of the bins in hertz, one bin high as pyAudioAnalysis has them.
    frequencies: Vec<f64>,
    filters: Vec<Filter>,
    dct: Array2<f64>,
    chroma: Vec<ChromaBin>,
}

impl std::fmt::Debug for PaaPlan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { sr, window, step, .. } = self;
        write!(f, "PaaPlan {{ sr: {sr}, window: {window}, step: {step} }}")
    }
}

impl PaaPlan {
    /// Makes the tables.
    ///
    /// # Errors
    /// A step of 0, or a rate or window for which pyAudioAnalysis itself fails: its filters need
    /// about 6.9 kHz, its chroma code more bins than semitones.
    pub fn new(sr: f64, window: usize, step: usize) -> Result<Self> {
        require_rate(sr)?;
        if step == 0 {
            return Err(DspError::parameter("step", step, "at least 1"));
        }
        let num_fft = window / 2;
        if num_fft == 0 {
            return Err(DspError::parameter("window", window, "at least 2 samples"));
        }
        Ok(Self {
            sr,
            window,
            step,
            peak: Peak::default(),
            fft: FftPlanner::new().plan_fft_forward(window),
            frequencies: (1..=num_fft).map(|k| k as f64 * (sr / (2.0 * num_fft as f64))).collect(),
            filters: tables::filters(sr, num_fft)?,
            dct: tables::dct(),
            chroma: tables::chroma_bins(sr, num_fft)?,
        })
    }

    /// The same with another peak to divide by.
    #[must_use]
    pub fn with_peak(self, peak: Peak) -> Self {
        Self { peak, ..self }
    }

    /// Frames of a signal of `n` samples; no padding.
    pub fn n_frames(&self, n: usize) -> usize {
        if n < self.window { 0 } else { (n - self.window) / self.step + 1 }
    }

    /// Short-term features `[34, frames]` of a whole mono recording, or `[68, frames]` with
    /// `deltas` (pyAudioAnalysis `feature_extraction`). 16-bit counts are what it expects; samples
    /// in -1..1 work as well, nearly scale-free.
    ///
    /// # Errors
    /// Non-finite samples, or fewer than one window of them.
    pub fn short_term<T: Real>(&self, y: ArrayView1<T>, deltas: bool) -> Result<Array2<f64>> {
        let y = y.as_standard_layout();
        self.short_term_of(y.as_slice().expect("standard layout"), |v| v.wide(), deltas)
    }

    /// As [`short_term`](Self::short_term), of the counts that `count` makes of the samples. No copy
    /// of the signal is made.
    pub(crate) fn short_term_of<T: Real>(
        &self,
        y: &[T],
        count: impl Fn(T) -> f64 + Copy,
        deltas: bool,
    ) -> Result<Array2<f64>> {
        require_finite("y", y)?;
        let frames = self.n_frames(y.len());
        if frames == 0 {
            return Err(DspError::TooShort { name: "y", actual: y.len(), needed: self.window });
        }
        let level = Level::of(y, count, self.peak);
        let rows = if deltas { 2 * N_SHORT } else { N_SHORT };
        let mut out = Array2::zeros((rows, frames));
        let mut frame = Frame::new(self);
        for t in 0..frames {
            let start = t * self.step;
            level.apply(&y[start..start + self.window], count, &mut frame.signal);
            frame.analyse(self, t == 0);
            for (i, &v) in frame.features.iter().enumerate() {
                out[[i, t]] = v;
                if deltas && t > 0 {
                    out[[N_SHORT + i, t]] = v - out[[i, t - 1]];
                }
            }
        }
        Ok(out)
    }
}

/// Working memory of one frame after another.
struct Frame {
    /// The frame at hand, to be filled.
    signal: Vec<f64>,
    features: [f64; N_SHORT],
    spectrum: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    magnitude: Vec<f64>,
    power: Vec<f64>,
    /// Magnitudes relative to the largest.
    relative: Vec<f64>,
    /// Magnitudes relative to their sum, of this frame and of the one before.
    share: Vec<f64>,
    previous: Vec<f64>,
}

impl Frame {
    fn new(plan: &PaaPlan) -> Self {
        let bins = || vec![0.0; plan.window / 2];
        Self {
            signal: vec![0.0; plan.window],
            features: [0.0; N_SHORT],
            spectrum: vec![Complex::default(); plan.window],
            scratch: vec![Complex::default(); plan.fft.get_inplace_scratch_len()],
            magnitude: bins(),
            power: bins(),
            relative: bins(),
            share: bins(),
            previous: bins(),
        }
    }

    fn analyse(&mut self, plan: &PaaPlan, first: bool) {
        for (z, &v) in self.spectrum.iter_mut().zip(&self.signal) {
            *z = Complex::new(v, 0.0);
        }
        plan.fft.process_with_scratch(&mut self.spectrum, &mut self.scratch);
        let spectral_energy = vectorized(
            #[inline(always)]
            || self.in_vectors(plan, first),
        );
        self.features[7] = self.rolloff(spectral_energy);
        self.cepstrum(plan);
        self.chroma(plan, spectral_energy);
    }

    /// Everything that runs over all samples or bins, but the roll-off. Returns the energy of the
    /// spectrum.
    #[inline(always)]
    fn in_vectors(&mut self, plan: &PaaPlan, first: bool) -> f64 {
        let bins = self.magnitude.len() as f64;
        for ((m, p), z) in self.magnitude.iter_mut().zip(&mut self.power).zip(&self.spectrum) {
            *m = z.norm_sqr().sqrt() / bins;
            *p = *m * *m;
        }
        let energy = sum(&self.signal, |v| v * v);
        let spectral_energy = sum(&self.power, |p| p);
        self.features[0] = zero_crossing_rate(&self.signal);
        self.features[1] = energy / self.signal.len() as f64;
        self.features[2] = block_entropy(&self.signal, energy);
        (self.features[3], self.features[4]) = self.centroid_and_spread(plan);
        self.features[5] = block_entropy(&self.magnitude, spectral_energy);
        self.features[6] = self.flux();
        if first {
            self.features[6] = 0.0;
        }
        spectral_energy
    }

    #[inline(always)]
    fn centroid_and_spread(&mut self, plan: &PaaPlan) -> (f64, f64) {
        let (_, max) = extremes(&self.magnitude, |m| m);
        let scale = if max == 0.0 { EPS } else { max };
        self.relative.iter_mut().zip(&self.magnitude).for_each(|(r, m)| *r = m / scale);
        let total = sum(&self.relative, |r| r) + EPS;
        let centroid = sum_pairs(&self.relative, &plan.frequencies, |r, f| f * r) / total;
        let offset = |r: f64, f: f64| (f - centroid) * (f - centroid) * r;
        let spread = (sum_pairs(&self.relative, &plan.frequencies, offset) / total).sqrt();
        let nyquist = plan.sr / 2.0;
        (centroid / nyquist, spread / nyquist)
    }

    #[inline(always)]
    fn flux(&mut self) -> f64 {
        std::mem::swap(&mut self.share, &mut self.previous);
        let total = sum(&self.magnitude, |m| m + EPS);
        self.share.iter_mut().zip(&self.magnitude).for_each(|(s, m)| *s = m / total);
        sum_pairs(&self.share, &self.previous, |s, p| (s - p) * (s - p))
    }

    fn rolloff(&self, energy: f64) -> f64 {
        let threshold = 0.90 * energy;
        let mut running = 0.0;
        let reached = self.power.iter().position(|p| {
            running += p;
            running + EPS > threshold
        });
        reached.map_or(0.0, |k| k as f64 / self.power.len() as f64)
    }

    fn cepstrum(&mut self, plan: &PaaPlan) {
        let mel: Vec<f64> = plan
            .filters
            .iter()
            .map(|f| {
                let bins = &self.magnitude[f.first..f.first + f.weights.len()];
                (sum_pairs(bins, &f.weights, |m, w| w * m) + EPS).log10()
            })
            .collect();
        for (slot, row) in self.features[8..8 + N_MFCC].iter_mut().zip(plan.dct.outer_iter()) {
            *slot = row.iter().zip(&mel).map(|(d, m)| d * m).sum();
        }
    }

    fn chroma(&mut self, plan: &PaaPlan, energy: f64) {
        let mut classes = [0.0; N_CHROMA];
        for b in &plan.chroma {
            classes[b.class] += self.power[b.bin] / b.divisor;
        }
        let scale = if energy == 0.0 { EPS } else { energy };
        for c in &mut classes {
            *c /= scale;
        }
        let mean = classes.iter().sum::<f64>() / N_CHROMA as f64;
        let variance = classes.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / N_CHROMA as f64;
        self.features[21..21 + N_CHROMA].copy_from_slice(&classes);
        self.features[33] = variance.sqrt();
    }
}

/// A zero sample counts as half a crossing on each side.
#[inline(always)]
fn zero_crossing_rate(x: &[f64]) -> f64 {
    let sign = |v: &f64| i32::from(*v > 0.0) - i32::from(*v < 0.0);
    let pairs = x.iter().zip(x.get(1..).unwrap_or_default());
    let changes: i32 = pairs.map(|(a, b)| (sign(b) - sign(a)).abs()).sum();
    f64::from(changes) / 2.0 / (x.len() as f64 - 1.0)
}

/// Entropy of the energies of ten blocks relative to the energy of all (a tail that fills no block
/// counts in the total only).
#[inline(always)]
fn block_entropy(x: &[f64], energy: f64) -> f64 {
    let len = x.len() / BLOCKS;
    let terms = (0..BLOCKS).map(|b| {
        let share = sum(&x[b * len..(b + 1) * len], |v| v * v) / (energy + EPS);
        share * (share + EPS).log2()
    });
    -terms.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array1;

    #[test]
    fn shapes_and_refusals() {
        let plan = PaaPlan::new(44100.0, 2205, 2205).unwrap();
        let y = Array1::from_shape_fn(10_000, |i| ((i * i % 977) as f64 - 488.0) / 500.0);
        let f = plan.short_term(y.view(), true).unwrap();
        assert_eq!(f.dim(), (68, 4));
        assert!(f.column(0).iter().skip(N_SHORT).all(|&d| d == 0.0));
        assert!((f[[34, 2]] - (f[[0, 2]] - f[[0, 1]])).abs() < 1e-15);
        assert_eq!(short_names().len(), N_SHORT);
        assert!(PaaPlan::new(44100.0, 200, 200).is_err());
        assert!(PaaPlan::new(6000.0, 600, 600).is_err());
        assert!(PaaPlan::new(44100.0, 2205, 0).is_err());
        assert!(plan.short_term(y.slice(ndarray::s![..100]), true).is_err());
    }

    #[test]
    fn silence_is_finite_and_a_tone_is_where_it_should_be() {
        let plan = PaaPlan::new(16000.0, 800, 400).unwrap();
        let silence = plan.short_term(Array1::<f32>::zeros(4000).view(), true).unwrap();
        assert!(silence.iter().all(|v| v.is_finite()));
        let tone = Array1::from_shape_fn(4000, |i| (i as f64 * 0.1).sin());
        let f = plan.short_term(tone.view(), false).unwrap();
        // 0.1 rad per sample is 0.0318 of the Nyquist frequency.
        assert!((f[[7, 1]] - 0.0318).abs() < 0.003);
        assert!((f[[0, 1]] - 0.0318).abs() < 0.003);
    }
}
