//! M5 (Because It's Tactile): pyAudioAnalysis statistics and the input of VGGish.

use ndarray::{Array1, Array2, Array3, ArrayView1, ArrayView2, s};

use super::mono_at;
use super::paa::{MidTerm, PaaPlan, Peak, file_vector};
use crate::error::{DspError, Result};
use crate::lanes::{DoubleRow, Lanes, Spectrum, square_roots, weighted_sums};
use crate::mono::to_mono;
use crate::resample::ResType;
use crate::window::{Window, get_window};

/// Weights of the eight channels of a 7.1 recording in its mono mix, in the order of the file:
/// front left and right, centre, low frequency (left out), back and side pairs. They sum to 1.
pub fn downmix_71_weights() -> [f64; 8] {
    let front = std::f64::consts::FRAC_1_SQRT_2;
    let weights = [front, front, 1.0, 0.0, 0.5, 0.5, 0.5, 0.5];
    weights.map(|w| w / weights.iter().sum::<f64>())
}

/// The mono mix of `y` in -1..1 that `ffmpeg -ac 1` makes, as 16-bit counts: eight channels are
/// taken for 7.1, one or two are averaged.
///
/// # Errors
/// Another number of channels.
pub fn downmix_71(y: ArrayView2<f32>) -> Result<Array1<f64>> {
    let mix: Array1<f64> = match y.nrows() {
        8 => {
            let weights = Array1::from_vec(downmix_71_weights().to_vec());
            y.mapv(f64::from).t().dot(&weights)
        }
        1 | 2 => to_mono(y.mapv(f64::from).view())?,
        _ => {
            let expected = "1, 2 or 8 channels".into();
            return Err(DspError::Shape { name: "y", expected, actual: y.shape().to_vec() });
        }
    };
    Ok(mix.mapv(count_16))
}

/// The 16-bit count of a sample in -1..1.
#[inline(always)]
fn count_16(v: f64) -> f64 {
    (v * 32768.0).round().clamp(-32768.0, 32767.0)
}

/// The 136 values per recording that the random forests take: 34 short-term features of 50 ms
/// frames and their deltas, mean and deviation over each second, mean over the seconds. The
/// pyAudioAnalysis of the time divided by the peak before centring, which moves the first cepstral
/// coefficient.
#[derive(Debug)]
pub struct M5A34f136 {
    plan: PaaPlan,
    mid: MidTerm,
}

impl M5A34f136 {
    /// Makes the tables for recordings of rate `sr`.
    ///
    /// # Errors
    /// A rate that pyAudioAnalysis cannot take, see [`PaaPlan::new`].
    pub fn new(sr: f64) -> Result<Self> {
        Self::with_peak(sr, Peak::Raw)
    }

    /// The same by another version of pyAudioAnalysis.
    ///
    /// # Errors
    /// As [`M5A34f136::new`].
    pub fn with_peak(sr: f64, peak: Peak) -> Result<Self> {
        // Memory grows with it: a frame has 50 ms.
        if sr > MAX_SR {
            return Err(DspError::parameter("sr", sr, "at most 768,000 Hz"));
        }
        let samples = |seconds: f64| (seconds * sr).round_ties_even().max(0.0) as usize;
        let (frame, second) = (samples(0.05), samples(1.0));
        let plan = PaaPlan::new(sr, frame, frame)?.with_peak(peak);
        Ok(Self { plan, mid: MidTerm::from_samples(second, second, frame, frame)? })
    }

    /// 136 values of `y [1, 2 or 8 channels, samples]`, by way of [`downmix_71`].
    ///
    /// # Errors
    /// Another number of channels, non-finite samples, less than 50 ms.
    pub fn run(&self, y: ArrayView2<f32>) -> Result<Array1<f64>> {
        let short = match y.as_slice() {
            Some(mono) if y.nrows() == 1 => {
                self.plan.short_term_of(mono, |v| count_16(v.into()), true)?
            }
            _ => self.plan.short_term(downmix_71(y)?.view(), true)?,
        };
        Ok(file_vector(self.mid.statistics(short.view()).view()))
    }
}

/// Highest sample rate of a frame of 50 ms.
const MAX_SR: f64 = 768_000.0;
const VGGISH_SR: f64 = 16_000.0;
const FRAME: usize = 400;
const HOP: usize = 160;
const N_FFT: usize = 512;
const BANDS: usize = 64;
const PATCH: usize = 96;

/// Log-mel patches of 0.96 s for VGGish: mean channel at 16 kHz, 25 ms frames every 10 ms, 64 bands
/// of magnitudes from 125 to 7500 Hz, `ln(mel + 0.01)`. A last part of less than 0.96 s is dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct M5VggishPatches {
    /// Converter to 16 kHz; VGGish's own code uses resampy's `kaiser_best`.
    pub res_type: ResType,
}

impl Default for M5VggishPatches {
    fn default() -> Self {
        Self { res_type: ResType::KaiserBest }
    }
}

impl M5VggishPatches {
    /// `[patches, 96 frames, 64 bands]` of `y [channels, samples]`; no patch where it is too short.
    ///
    /// # Errors
    /// Impossible rates, non-finite samples.
    pub fn run(&self, y: ArrayView2<f32>, sr: f64) -> Result<Array3<f32>> {
        let mono = mono_at(y, sr, VGGISH_SR, self.res_type)?;
        let log_mel = vggish_log_mel(mono.view())?;
        let patches = log_mel.nrows() / PATCH;
        let whole = log_mel.slice(s![..patches * PATCH, ..]).to_owned();
        Ok(whole.into_shape_with_order((patches, PATCH, BANDS)).expect("whole patches"))
    }
}

/// `[frames, 64]`, no padding.
fn vggish_log_mel(y: ArrayView1<f32>) -> Result<Array2<f32>> {
    let frames = if y.len() < FRAME { 0 } else { 1 + (y.len() - FRAME) / HOP };
    let mut window = get_window(&Window::Hann, FRAME, true)?;
    window.resize(N_FFT, 0.0);
    let bank = vggish_bank();
    let spectrum = Spectrum::<DoubleRow>::new(N_FFT)?;
    let rows = |count| vec![DoubleRow::EMPTY; count];
    let (mut work, mut bins, mut mel) = (rows(N_FFT), rows(spectrum.n_bins()), rows(BANDS));
    // Frames are taken several at a time, whole transforms of them.
    let mut samples = y.to_vec();
    samples.resize(frames.next_multiple_of(DoubleRow::SLOTS) * HOP + N_FFT, 0.0);
    let mut out = Array2::zeros((frames, BANDS));
    for first in (0..frames).step_by(DoubleRow::SLOTS) {
        DoubleRow::gather(&samples[first * HOP..], HOP, &window, &mut work);
        spectrum.power(&mut work, &mut bins);
        square_roots(&mut bins);
        weighted_sums(&bank, &bins, &mut mel);
        let mut part = out.slice_mut(s![first..frames.min(first + DoubleRow::SLOTS), ..]);
        for (s, mut frame) in part.outer_iter_mut().enumerate() {
            for (slot, row) in frame.iter_mut().zip(&mel) {
                *slot = (row.0[s] + 0.01).ln() as f32;
            }
        }
    }
    Ok(out)
}

/// 64 triangles on the mel axis (not in hertz) of peak 1, without the DC bin: the first bin and the
/// weights of each.
fn vggish_bank() -> Vec<(usize, Vec<f64>)> {
    let mel = |hz: f64| 1127.0 * (1.0 + hz / 700.0).ln();
    let (low, high) = (mel(125.0), mel(7500.0));
    let edge = |i: usize| low + (high - low) * i as f64 / (BANDS + 1) as f64;
    let weight = |b: usize, k: usize| {
        let at = mel(k as f64 * VGGISH_SR / N_FFT as f64);
        let (left, centre, right) = (edge(b), edge(b + 1), edge(b + 2));
        ((at - left) / (centre - left)).min((right - at) / (right - centre))
    };
    (0..BANDS)
        .map(|b| {
            let inside = (1..=N_FFT / 2).filter(|k| weight(b, *k) > 0.0);
            let first = inside.clone().next().unwrap_or(0);
            (first, inside.map(|k| weight(b, k)).collect())
        })
        .collect()
}
