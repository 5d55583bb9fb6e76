//! M4 (HVRL, Keio): a log-mel spectrogram of every channel.

use ndarray::{Array3, Array4, ArrayView2, ArrayView3, s};
use rayon::prelude::*;

use super::Variant;
use crate::error::{DspError, Result};
use crate::frequency::require_rate;
use crate::lanes::{DoubleRow, Lanes, Spectrum, decibel_double, gather_double, weighted_sums};
use crate::mel::{hz_to_mel, mel_to_hz};
use crate::real::{all_finite, require_finite};
use crate::simd::vectorized;
use crate::window::{Window, get_window};

const BANDS: usize = 64;
const PRE_EMPHASIS: f64 = 0.97;
const WINDOW_FRAMES: usize = 64;
const WINDOW_STEP: usize = 16;
/// Frames computed together: their samples stay in the cache.
const TOGETHER: usize = 8;
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
        let plan = self.plan(sr)?;
        let (channels, n) = y.dim();
        let shape = (plan.frames(n), BANDS, channels);
        let frames = if channels == 1 {
            plan.interleaved(&y.row(0).as_standard_layout().to_vec(), 1)?
        } else {
            let mut interleaved = Vec::with_capacity(y.len());
            interleaved.extend(y.t().iter());
            plan.interleaved(&interleaved, channels)?
        };
        Ok(Array3::from_shape_vec(shape, frames).expect("as many values"))
    }

    /// Window, filters and transform for one sample rate.
    ///
    /// # Errors
    /// A rate below 100 Hz or above 2.6 MHz.
    pub fn plan(&self, sr: f64) -> Result<M4Plan> {
        require_rate(sr)?;
        let length = (0.025 * sr).round_ties_even() as usize;
        let step = (0.01 * sr).round_ties_even() as usize;
        if step == 0 {
            return Err(DspError::parameter("sr", sr, "at least 100 Hz"));
        }
        if length > MAX_LENGTH {
            let most = MAX_LENGTH as f64 / 0.025;
            return Err(DspError::parameter("sr", sr, format!("at most {most} Hz")));
        }
        let (n_fft, factor) = match self.variant {
            Variant::Code => (512, 2.0),
            Variant::Paper => (length.next_power_of_two(), 1.0),
        };
        let mut window = get_window(&Window::Hamming, length, false)?;
        // Behind the window there are zeros only.
        window.truncate(n_fft);
        let (bank, spectrum) = (triangles(sr, n_fft), Spectrum::new(n_fft)?);
        Ok(M4Plan { length, step, n_fft, factor, window, bank, spectrum })
    }
}

/// [`M4LogMel`] for one sample rate.
pub struct M4Plan {
    /// Samples of a frame, and from one to the next.
    length: usize,
    step: usize,
    n_fft: usize,
    /// Tens of decibels.
    factor: f64,
    /// As much of it as the transform sees.
    window: Vec<f64>,
    bank: Vec<(usize, Vec<f64>)>,
    spectrum: Spectrum<DoubleRow>,
}

/// What one thread computes in.
struct Work {
    emphasised: Vec<f64>,
    frames: Vec<DoubleRow>,
    power: Vec<DoubleRow>,
    energies: Vec<DoubleRow>,
    values: Vec<f64>,
}

impl M4Plan {
    /// Frames of `n` samples.
    pub fn frames(&self, n: usize) -> usize {
        n.abs_diff(self.length).div_ceil(self.step)
    }

    /// `[frames][64][channels]` of interleaved samples.
    ///
    /// # Errors
    /// No or non-finite samples.
    pub fn interleaved(&self, samples: &[f32], channels: usize) -> Result<Vec<f32>> {
        if samples.is_empty() || channels == 0 {
            return Err(DspError::TooShort { name: "y", actual: 0, needed: 1 });
        }
        if !all_finite(samples) {
            require_finite("y", samples)?;
        }
        let frames = self.frames(samples.len() / channels);
        let mut out = vec![0.0; frames * BANDS * channels];
        out.par_chunks_mut(TOGETHER * BANDS * channels).enumerate().with_min_len(8).for_each_init(
            || self.work(),
            |work, (i, out)| self.together(samples, channels, i * TOGETHER, work, out),
        );
        Ok(out)
    }

    fn work(&self) -> Work {
        let rows = |count| vec![DoubleRow::EMPTY; count];
        Work {
            emphasised: Vec::new(),
            frames: rows(self.n_fft),
            power: rows(self.spectrum.n_bins()),
            energies: rows(BANDS),
            values: vec![0.0; BANDS * DoubleRow::SLOTS],
        }
    }

    /// Up to [`TOGETHER`] frames from frame `first` on.
    fn together(
        &self,
        samples: &[f32],
        channels: usize,
        first: usize,
        work: &mut Work,
        out: &mut [f32],
    ) {
        const SLOTS: usize = DoubleRow::SLOTS;
        let Work { emphasised, frames, power, energies, values } = work;
        let used = self.window.len();
        emphasised.resize(((TOGETHER - 1) * self.step + used) * channels, 0.0);
        pre_emphasised(samples, channels, first * self.step, emphasised);
        let slots = out.len() / BANDS;
        for slot in (0..slots).step_by(SLOTS) {
            let (samples, window) = (&emphasised[..], &self.window);
            gather_double(samples, self.step, window, (slot, channels), &mut frames[..used]);
            frames[used..].fill(DoubleRow::EMPTY);
            self.spectrum.power(frames, power);
            weighted_sums(&self.bank, power, energies);
            to_decibels(energies, self.n_fft as f64, self.factor, values);
            if channels == SLOTS {
                let out = &mut out[slot * BANDS..(slot + SLOTS) * BANDS];
                out.iter_mut().zip(&*values).for_each(|(out, x)| *out = *x as f32);
                continue;
            }
            for s in 0..SLOTS.min(slots - slot) {
                let (frame, channel) = ((slot + s) / channels, (slot + s) % channels);
                let out = out[frame * BANDS * channels + channel..].iter_mut().step_by(channels);
                let values = values.as_chunks::<SLOTS>().0;
                out.zip(values).for_each(|(out, x)| *out = x[s] as f32);
            }
        }
    }
}

/// 16-bit counts of interleaved samples from `frame` on, each less a share of the one before in its
/// channel; zeros after the last.
fn pre_emphasised(samples: &[f32], channels: usize, frame: usize, out: &mut [f64]) {
    let count = |x: f32| f64::from(x) * 32768.0;
    let from = (frame * channels).min(samples.len());
    let (out, zeros) = out.split_at_mut(out.len().min(samples.len() - from));
    zeros.fill(0.0);
    // Nothing is before the first.
    let alone = if from == 0 { channels.min(out.len()) } else { 0 };
    let (first, rest) = out.split_at_mut(alone);
    first.iter_mut().zip(samples).for_each(|(slot, x)| *slot = count(*x));
    let current = &samples[from + alone..][..rest.len()];
    let before = &samples[(from + alone).saturating_sub(channels)..][..rest.len()];
    vectorized(
        #[inline(always)]
        || {
            for ((slot, x), before) in rest.iter_mut().zip(current).zip(before) {
                *slot = count(*x) - PRE_EMPHASIS * count(*before);
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
    let scale = 1.0 / n_fft;
    // One long loop: rows of eight would be computed value by value.
    vectorized(
        #[inline(always)]
        || {
            for value in values {
                // The length is a power of two: exact.
                let scaled = *value * scale;
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
