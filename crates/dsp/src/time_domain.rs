//! Features of the waveform: zero-crossing rate and root-mean-square level (librosa 0.11
//! `feature.zero_crossing_rate`, `feature.rms`).

use ndarray::{Array3, ArrayView2, ArrayView3};

use crate::error::{DspError, Result};
use crate::real::Real;
use crate::simd::vectorized;
use crate::stft::PadMode;
use crate::sums;
use crate::tiles::{for_each_tile, planar};

/// How a signal is cut into frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameParams {
    /// Samples in a frame.
    pub frame_length: usize,
    /// Samples between frames.
    pub hop_length: usize,
    /// Frame `t` is centred on sample `t * hop_length`.
    pub center: bool,
}

impl Default for FrameParams {
    fn default() -> Self {
        Self { frame_length: 2048, hop_length: 512, center: true }
    }
}

impl FrameParams {
    /// Refuses zero lengths.
    pub fn check(&self) -> Result<()> {
        if self.frame_length == 0 {
            return Err(DspError::parameter("frame_length", 0, "at least 1"));
        }
        if self.hop_length == 0 {
            return Err(DspError::parameter("hop_length", 0, "at least 1"));
        }
        Ok(())
    }

    /// Samples of padding on each side.
    pub fn pad(&self) -> usize {
        if self.center { self.frame_length / 2 } else { 0 }
    }

    /// Frames of `n` samples; 0 where they are too few for one.
    pub fn n_frames(&self, n: usize) -> usize {
        let padded = n + 2 * self.pad();
        if n == 0 || padded < self.frame_length {
            0
        } else {
            1 + (padded - self.frame_length) / self.hop_length
        }
    }

    fn frames_of(&self, n: usize) -> Result<usize> {
        self.check()?;
        match self.n_frames(n) {
            0 => {
                let needed = if self.center { 1 } else { self.frame_length };
                Err(DspError::TooShort { name: "y", actual: n, needed })
            }
            frames => Ok(frames),
        }
    }
}

/// What counts as a crossing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZeroCrossingParams {
    /// Values of at most this magnitude count as zero.
    pub threshold: f64,
    /// Zero is positive (true), or a sign of its own (false).
    pub zero_pos: bool,
    /// Whether the first sample of each frame counts as a crossing.
    pub pad: bool,
}

impl Default for ZeroCrossingParams {
    fn default() -> Self {
        Self { threshold: 1e-10, zero_pos: true, pad: false }
    }
}

impl ZeroCrossingParams {
    /// Refuses a negative threshold.
    pub fn check(&self) -> Result<()> {
        if self.threshold.is_nan() || self.threshold < 0.0 {
            return Err(DspError::parameter("threshold", self.threshold, "0 or more"));
        }
        Ok(())
    }

    /// Crossings of each channel of interleaved `samples` within each of `spans`, as
    /// `[spans][channels]`. A span is its first and its last frame; the one before the first does
    /// not count. The threshold is compared in the precision of the signal, as librosa does.
    pub fn count<T: Real>(
        &self,
        samples: &[T],
        channels: usize,
        spans: impl Iterator<Item = (usize, usize)> + Clone,
    ) -> Vec<u32> {
        // Spans overlap: what lies between two neighbouring marks is counted once.
        let mut marks: Vec<usize> = spans.clone().flat_map(|(first, last)| [first, last]).collect();
        marks.sort_unstable();
        marks.dedup();
        let mut until = vec![0; marks.len() * channels];
        for (m, pair) in marks.windows(2).enumerate() {
            let (before, after) = until.split_at_mut((m + 1) * channels);
            let total = &mut after[..channels];
            total.copy_from_slice(&before[m * channels..]);
            let samples = &samples[pair[0] * channels..(pair[1] + 1) * channels];
            vectorized(
                #[inline(always)]
                || self.add(samples, channels, total),
            );
        }
        let at = |frame: usize| {
            let mark = marks.binary_search(&frame).expect("every end of a span is a mark");
            &until[mark * channels..][..channels]
        };
        let within = |(first, last)| at(last).iter().zip(at(first)).map(|(b, a)| b - a);
        spans.flat_map(within).collect()
    }

    /// Adds the crossings of each channel between the first and the last frame of `samples`.
    #[inline(always)]
    fn add<T: Real>(&self, samples: &[T], channels: usize, total: &mut [u32]) {
        const LANES: usize = 16;
        let high = T::of(self.threshold);
        let (low, zero_is_a_sign) = (-high, !self.zero_pos);
        let crossed = |a: T, b: T| {
            let negative = (a < low) != (b < low);
            u32::from(negative | (zero_is_a_sign & ((a > high) != (b > high))))
        };
        let pairs = samples.len() - channels;
        let (before, after) = (&samples[..pairs], &samples[channels..]);
        let whole = if LANES.is_multiple_of(channels) { pairs / LANES * LANES } else { 0 };
        let mut lanes = [0; LANES];
        let blocks = before[..whole].as_chunks::<LANES>().0.iter();
        for (a, b) in blocks.zip(after[..whole].as_chunks::<LANES>().0) {
            for i in 0..LANES {
                lanes[i] += crossed(a[i], b[i]);
            }
        }
        if whole > 0 {
            lanes.iter().enumerate().for_each(|(i, n)| total[i % channels] += n);
        }
        for (i, (a, b)) in before[whole..].iter().zip(&after[whole..]).enumerate() {
            total[i % channels] += crossed(*a, *b);
        }
    }
}

/// Share of samples in each frame at which the signal crosses zero, `[channels, 1, frames]`, edge
/// values repeated by `center` (librosa 0.11 `feature.zero_crossing_rate`).
///
/// # Errors
/// Impossible parameters, or a signal too short for one frame.
pub fn zero_crossing_rate<T: Real>(
    y: ArrayView2<T>,
    frame: &FrameParams,
    p: &ZeroCrossingParams,
) -> Result<Array3<f64>> {
    p.check()?;
    let (channels, n) = y.dim();
    let frames = frame.frames_of(n)?;
    let y = planar(y);
    let mut out = Array3::zeros((channels, 1, frames));
    // Outside the signal nothing changes.
    let inside = |i: usize| i.saturating_sub(frame.pad()).min(n - 1);
    for_each_tile(
        out.view_mut(),
        || (),
        |(), mut tile| {
            let signal = y.row(tile.channel);
            let frames = tile.first..tile.first + tile.out.ncols();
            let spans = frames.map(|t| {
                let start = t * frame.hop_length;
                (inside(start), inside(start + frame.frame_length - 1))
            });
            let counts = p.count(signal.to_slice().expect("contiguous"), 1, spans);
            for (slot, count) in tile.out.iter_mut().zip(counts) {
                *slot = f64::from(count + u32::from(p.pad)) / frame.frame_length as f64;
            }
        },
    );
    Ok(out)
}

/// Root of the mean square of each channel of one interleaved frame `[samples][channels]`, into
/// `out`; `sums` holds as many values.
///
/// One channel is added up in lanes, several each in its own: either way no addition waits for the
/// one before.
pub fn level<T: Real>(frame: &[T], sums: &mut [f64], out: &mut [f32]) {
    let channels = sums.len();
    let square = |x: T| x.wide() * x.wide();
    vectorized(
        #[inline(always)]
        || {
            if let [sum] = sums {
                *sum = sums::sum(frame, square);
                return;
            }
            sums.fill(0.0);
            for samples in frame.chunks_exact(channels) {
                for (sum, x) in sums.iter_mut().zip(samples) {
                    *sum += square(*x);
                }
            }
        },
    );
    let samples = (frame.len() / channels) as f64;
    for (out, sum) in out.iter_mut().zip(sums) {
        *out = (*sum / samples).sqrt() as f32;
    }
}

/// Root of the mean square of each frame, `[channels, 1, frames]`, always `f32` (librosa 0.11
/// `feature.rms` given `y`).
///
/// # Errors
/// Impossible parameters, or a signal too short for one frame.
pub fn rms<T: Real>(
    y: ArrayView2<T>,
    frame: &FrameParams,
    pad_mode: PadMode,
) -> Result<Array3<f32>> {
    let y = planar(y);
    let (channels, n) = y.dim();
    let frames = frame.frames_of(n)?;
    let mut out = Array3::zeros((channels, 1, frames));
    let state = || vec![T::zero(); frame.frame_length];
    for_each_tile(out.view_mut(), state, |padded, mut tile| {
        let signal = y.row(tile.channel);
        let signal = signal.to_slice().expect("contiguous");
        for (t, slot) in tile.out.iter_mut().enumerate() {
            let start = ((tile.first + t) * frame.hop_length) as isize - frame.pad() as isize;
            let inside = usize::try_from(start).ok();
            let samples = inside.and_then(|s| signal.get(s..s + frame.frame_length));
            let samples = samples.unwrap_or_else(|| {
                pad_mode.read(signal, start, padded);
                padded
            });
            level(samples, &mut [0.0], std::slice::from_mut(slot));
        }
    });
    Ok(out)
}

/// Root-mean-square level from a magnitude spectrogram `[channels, frame_length / 2 + 1, frames]`
/// by Parseval's relation (librosa 0.11 `feature.rms` given `S`).
///
/// # Errors
/// A spectrogram whose rows do not fit `frame_length`.
pub fn rms_of_spectrogram<T: Real>(s: ArrayView3<T>, frame_length: usize) -> Result<Array3<f32>> {
    let (channels, bins, frames) = s.dim();
    if frame_length == 0 || bins != frame_length / 2 + 1 {
        let expected = format!("{} bins for frame_length = {frame_length}", frame_length / 2 + 1);
        return Err(DspError::Shape { name: "S", expected, actual: s.shape().to_vec() });
    }
    let length = frame_length as f64;
    let halved = |k: usize| k == 0 || (frame_length.is_multiple_of(2) && k == bins - 1);
    Ok(Array3::from_shape_fn((channels, 1, frames), |(c, _, t)| {
        let sum: f64 = (0..bins)
            .map(|k| {
                let x = s[[c, k, t]].wide();
                if halved(k) { x * x / 2.0 } else { x * x }
            })
            .sum();
        (2.0 * sum / (length * length)).sqrt() as f32
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn alternating_signs_cross_at_every_sample() {
        let y = Array2::from_shape_fn((1, 4096), |(_, i)| if i % 2 == 0 { 1.0_f32 } else { -1.0 });
        let z = zero_crossing_rate(y.view(), &FrameParams::default(), &Default::default()).unwrap();
        assert_eq!(z[[0, 0, 4]], 2047.0 / 2048.0);
    }

    #[test]
    fn crossings_are_counted_within_each_span() {
        let sample = |i: usize, c: usize| ((i * 37 + c * 11 + i * i * 5) % 7) as f64 - 3.0;
        for (channels, threshold, zero_pos) in
            [(1, 0.0, true), (2, 0.0, false), (3, 1.0, true), (8, 1.0, false), (20, 0.5, true)]
        {
            let p = ZeroCrossingParams { threshold, zero_pos, pad: false };
            let samples: Vec<f64> =
                (0..500 * channels).map(|k| sample(k / channels, k % channels)).collect();
            let single: Vec<f32> = samples.iter().map(|x| *x as f32).collect();
            let spans = [(0, 99), (50, 149), (0, 0), (70, 499)];
            let sign = |i: usize, c: usize| match sample(i, c) {
                x if x < -threshold => -1,
                x if x > threshold || zero_pos => 1,
                _ => 0,
            };
            let crossings = |(first, last): (usize, usize), c: usize| {
                (first..last).filter(|i| sign(*i, c) != sign(i + 1, c)).count() as u32
            };
            let want: Vec<u32> =
                spans.iter().flat_map(|s| (0..channels).map(|c| crossings(*s, c))).collect();
            assert_eq!(p.count(&samples, channels, spans.into_iter()), want);
            assert_eq!(p.count(&single, channels, spans.into_iter()), want);
        }
    }

    #[test]
    fn constant_level() {
        let y = Array2::<f64>::from_elem((2, 8192), 0.5);
        let r = rms(y.view(), &FrameParams::default(), PadMode::Constant).unwrap();
        assert_eq!(r[[1, 0, 8]], 0.5);
    }

    #[test]
    fn short_signals_are_refused_without_center() {
        let y = Array2::<f32>::zeros((1, 100));
        let frame = FrameParams { center: false, ..FrameParams::default() };
        assert!(zero_crossing_rate(y.view(), &frame, &Default::default()).is_err());
    }
}
