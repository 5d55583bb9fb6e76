//! M4 (HVRL, Keio): a log-mel spectrogram of every channel.

use ndarray::{Array3, Array4, ArrayView2, ArrayView3, s};

use super::Variant;
use crate::error::{DspError, Result};
use crate::frequency::require_rate;
use crate::lanes::{DoubleRow, Lanes, Spectrum, decibel_double, weighted_sums};
use crate::mel::{hz_to_mel, mel_to_hz};
use crate::real::require_all_finite;
use crate::simd::vectorized;
use crate::window::{Window, get_window};

const BANDS: usize = 64;
const PRE_EMPHASIS: f64 = 0.97;
const WINDOW_FRAMES: usize = 64;
const WINDOW_STEP: usize = 16;
/// Longest frame; bounds the memory that the rate of a file can take.
const MAX_LENGTH: usize = 1 << 16;

/// 64 mel bands in dB of 25 ms frames every 10 ms, all channels, on 16-bit counts.
///
/// The code transforms each frame (1102 samples at 44.1 kHz) with 512 points, which drops all but
/// the first 512 samples, and takes 20 log10 of a power: [`Variant::Code`]. [`Variant::Paper`]
/// transforms whole frames (the next power of two) and takes 10 log10.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct M4LogMel {
    /// Paper or code.
    pub variant: Variant,
}

impl M4LogMel {
    /// `[frames, 64, channels]` of `y [channels, samples]`, the layout of the published features.
    ///
    /// # Errors
    /// No or non-finite samples, a rate below 100 Hz or above 2.6 MHz.
    pub fn run(&self, y: ArrayView2<f32>, sr: f64) -> Result<Array3<f32>> {
        require_rate(sr)?;
        require_all_finite("y", y)?;
        let length = (0.025 * sr).round_ties_even() as usize;
        let step = (0.01 * sr).round_ties_even() as usize;
        if step == 0 {
            return Err(DspError::parameter("sr", sr, "at least 100 Hz"));
        }
        if length > MAX_LENGTH {
            let most = MAX_LENGTH as f64 / 0.025;
            return Err(DspError::parameter("sr", sr, format!("at most {most} Hz")));
        }
        let (channels, n) = y.dim();
        if n == 0 {
            return Err(DspError::TooShort { name: "y", actual: 0, needed: 1 });
        }
        let (n_fft, decibels) = match self.variant {
            Variant::Code => (512, 20.0),
            Variant::Paper => (length.next_power_of_two(), 10.0),
        };
        let frames = n.abs_diff(length).div_ceil(step);
        let mut window = get_window(&Window::Hamming, length, false)?;
        window.resize(n_fft, 0.0);
        let bank = triangles(sr, n_fft);
        let spectrum = Spectrum::<DoubleRow>::new(n_fft)?;
        let rows = |count| vec![DoubleRow::EMPTY; count];
        let (mut work, mut power, mut energies) =
            (rows(n_fft), rows(spectrum.n_bins()), rows(BANDS));
        // Behind the window there are zeros only.
        let used = length.min(n_fft);
        let mut values = [0.0; BANDS * DoubleRow::SLOTS];
        let mut out = Array3::zeros((frames, BANDS, channels));
        let mut emphasised = Vec::new();
        for (c, signal) in y.outer_iter().enumerate() {
            pre_emphasised(&signal.to_vec(), &mut emphasised);
            // The zeros after the last sample are not pre-emphasised.
            let needed = frames.next_multiple_of(DoubleRow::SLOTS) * step + n_fft;
            emphasised.resize(n.max(needed), 0.0);
            for first in (0..frames).step_by(DoubleRow::SLOTS) {
                let samples = &emphasised[first * step..];
                DoubleRow::gather(samples, step, &window[..used], &mut work[..used]);
                work[used..].fill(DoubleRow::EMPTY);
                spectrum.power(&mut work, &mut power);
                weighted_sums(&bank, &power, &mut energies);
                to_decibels(&energies, n_fft as f64, decibels / 10.0, &mut values);
                let last = frames.min(first + DoubleRow::SLOTS);
                let mut part = out.slice_mut(s![first..last, .., c]);
                for (s, mut frame) in part.outer_iter_mut().enumerate() {
                    let values = values.as_chunks::<{ DoubleRow::SLOTS }>().0;
                    frame.iter_mut().zip(values).for_each(|(slot, x)| *slot = x[s] as f32);
                }
            }
        }
        Ok(out)
    }
}

/// 16-bit counts of `signal`, each less a share of the one before.
fn pre_emphasised(signal: &[f32], out: &mut Vec<f64>) {
    let count = |x: f32| f64::from(x) * 32768.0;
    out.clear();
    out.resize(signal.len(), 0.0);
    if let (Some(slot), Some(x)) = (out.first_mut(), signal.first()) {
        *slot = count(*x);
    }
    vectorized(
        #[inline(always)]
        || {
            for (slot, pair) in out.iter_mut().skip(1).zip(signal.windows(2)) {
                *slot = count(pair[1]) - PRE_EMPHASIS * count(pair[0]);
            }
        },
    );
}

/// Decibels times `factor` of energies of transforms that are not yet divided by their length, row
/// after row; of silence those of the smallest step above 1.
fn to_decibels(energies: &[DoubleRow], n_fft: f64, factor: f64, values: &mut [f64]) {
    for (values, row) in values.chunks_exact_mut(DoubleRow::SLOTS).zip(energies) {
        values.copy_from_slice(&row.0);
    }
    // One long loop: rows of eight would be computed value by value.
    vectorized(
        #[inline(always)]
        || {
            for value in values {
                let scaled = *value / n_fft;
                let normal = if scaled == 0.0 { f64::EPSILON } else { scaled };
                let least = if normal < f64::MIN_POSITIVE { f64::MIN_POSITIVE } else { normal };
                *value = factor * decibel_double(least);
            }
        },
    );
}

/// First bin and weights of each filter, its corners rounded down to bins.
fn triangles(sr: f64, n_fft: usize) -> Vec<(usize, Vec<f64>)> {
    let top = hz_to_mel(sr / 2.0, true);
    let corner = |i: usize| {
        let hz = mel_to_hz(top * i as f64 / (BANDS + 1) as f64, true);
        ((n_fft + 1) as f64 * hz / sr).floor() as usize
    };
    (0..BANDS)
        .map(|b| {
            let [low, centre, high] = [corner(b), corner(b + 1), corner(b + 2)];
            let rising = (low..centre).map(|k| (k - low) as f64 / (centre - low) as f64);
            let falling = (centre..high).map(|k| (high - k) as f64 / (high - centre) as f64);
            (low, rising.chain(falling).collect())
        })
        .collect()
}

/// Windows of 64 frames every 16, `[windows, channels, 64 frames, 64 bands]`, of features `[frames, 64,
/// channels]`; `ceil(|frames - 64| / 16)` of them, the last filled up with the floor of the code's
/// dB scale where frames are missing.
pub fn m4_windows(features: ArrayView3<f32>) -> Array4<f32> {
    let (frames, bands, channels) = features.dim();
    let count = frames.abs_diff(WINDOW_FRAMES).div_ceil(WINDOW_STEP);
    let floor = (20.0 * f64::EPSILON.log10()) as f32;
    let mut out = Array4::from_elem((count, channels, WINDOW_FRAMES, bands), floor);
    for w in 0..count {
        let start = (w * WINDOW_STEP).min(frames);
        let part = features.slice(s![start..(start + WINDOW_FRAMES).min(frames), .., ..]);
        let kept = part.dim().0;
        out.slice_mut(s![w, .., ..kept, ..]).assign(&part.permuted_axes([2, 0, 1]));
    }
    out
}
