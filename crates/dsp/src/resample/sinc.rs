//! resampy 0.2.2's windowed-sinc interpolation, which librosa used up to 0.9.

use std::f64::consts::PI;
use std::sync::Arc;

use ndarray::{Array2, ArrayView2};

use super::check::{check_interleaved, check_rates};
use crate::error::{DspError, Result};
use crate::real::Real;
use crate::window::bessel_i0;

/// Table entries per zero crossing.
const PRECISION: usize = 512;

/// The right half of a Kaiser-windowed sinc.
struct KaiserSinc {
    zeros: usize,
    rolloff: f64,
    beta: f64,
}

const KAISER_BEST: KaiserSinc =
    KaiserSinc { zeros: 64, rolloff: 0.9475937167399596, beta: 14.769656459379492 };
const KAISER_FAST: KaiserSinc = KaiserSinc { zeros: 16, rolloff: 0.85, beta: 8.555504641634386 };

impl KaiserSinc {
    fn half(&self) -> Vec<f64> {
        let n = PRECISION * self.zeros;
        let gain = self.rolloff / bessel_i0(self.beta);
        (0..=n)
            .map(|i| {
                let x = self.rolloff * i as f64 / PRECISION as f64 * PI;
                let r = i as f64 / n as f64;
                let sinc = if i == 0 { 1.0 } else { x.sin() / x };
                gain * sinc * bessel_i0(self.beta * (1.0 - r * r).max(0.0).sqrt())
            })
            .collect()
    }
}

/// The table that converts one rate to another as resampy's `kaiser_best` or `kaiser_fast`.
///
/// It serves a whole array ([`resample_windowed_sinc`]) and a stream ([`SincStream`]) with the same
/// bits.
#[derive(Debug, Clone)]
pub struct SincPlan {
    ratio: f64,
    /// Lower than 1 where the rate falls.
    scale: f64,
    /// Table entries between neighbouring samples.
    stride: usize,
    half: Vec<f64>,
}

impl SincPlan {
    /// Makes the table; `fast` for `kaiser_fast`.
    ///
    /// # Errors
    /// Impossible rates, or a target more than 512 times lower.
    pub fn new(orig_sr: f64, target_sr: f64, fast: bool) -> Result<Self> {
        check_rates(orig_sr, target_sr)?;
        let ratio = target_sr / orig_sr;
        let scale = ratio.min(1.0);
        let stride = (scale * PRECISION as f64) as usize;
        if stride == 0 {
            let least = orig_sr / PRECISION as f64;
            let allowed = format!("at least {least} Hz with a windowed sinc");
            return Err(DspError::parameter("target_sr", target_sr, allowed));
        }
        let kernel = if fast { KAISER_FAST } else { KAISER_BEST };
        let half = kernel.half().iter().map(|w| w * scale).collect();
        Ok(Self { ratio, scale, stride, half })
    }

    /// Samples that `n` samples become: the whole ones.
    fn filtered_len(&self, n: u64) -> u64 {
        (n as f64 * self.ratio) as u64
    }

    /// Samples on either side of an output that it may depend on.
    fn reach(&self) -> usize {
        self.half.len() / self.stride
    }

    /// Weights around the time of one output, in input samples, of a signal whose last sample is
    /// number `last`.
    fn weigh(&self, time: f64, last: usize, weights: &mut Weights) {
        weights.frame = (time as usize).min(last);
        let before = self.scale * (time - weights.frame as f64);
        self.wing(before, &mut weights.left);
        self.wing(self.scale - before, &mut weights.right);
    }

    /// Weights of the samples from a distance on, in zero crossings, outwards.
    fn wing(&self, distance: f64, weights: &mut Vec<f64>) {
        let at = distance * PRECISION as f64;
        let (offset, eta) = (at as usize, at - at.trunc());
        let count = self.half.len().saturating_sub(offset) / self.stride;
        weights.clear();
        weights.extend((0..count).map(|i| {
            let at = offset + i * self.stride;
            let step = self.half.get(at + 1).map_or(0.0, |next| next - self.half[at]);
            self.half[at] + eta * step
        }));
    }
}

/// Weights of the samples around one output.
#[derive(Debug, Clone, Default)]
struct Weights {
    /// The last sample not after the output.
    frame: usize,
    /// Of `frame` and the samples before it.
    left: Vec<f64>,
    /// Of the samples after it.
    right: Vec<f64>,
}

impl Weights {
    /// The output of the samples from number `start` on, of which there are `n`. The sum is rounded
    /// to `T` at every sample, as resampy's is.
    fn output<T: Real>(&self, start: usize, n: usize, sample: impl Fn(usize) -> T) -> T {
        let mut sum = T::zero();
        let mut add = |weight: &f64, i: usize| {
            sum = T::of(sum.wide() + weight * sample(i).wide());
        };
        let frame = self.frame - start;
        self.left.iter().enumerate().take(frame + 1).for_each(|(i, w)| add(w, frame - i));
        let after = n.saturating_sub(frame + 1);
        self.right.iter().enumerate().take(after).for_each(|(i, w)| add(w, frame + i + 1));
        sum
    }
}

/// `y [channels, samples]` at another rate by resampy's `kaiser_best` (or `fast`: `kaiser_fast`),
/// `floor(samples * target_sr / orig_sr)` samples long.
///
/// # Errors
/// As [`SincPlan::new`].
pub fn resample_windowed_sinc<T: Real>(
    y: ArrayView2<T>,
    orig_sr: f64,
    target_sr: f64,
    fast: bool,
) -> Result<Array2<T>> {
    let plan = SincPlan::new(orig_sr, target_sr, fast)?;
    let n = y.ncols();
    let mut out = Array2::zeros((y.nrows(), plan.filtered_len(n as u64) as usize));
    let mut weights = Weights::default();
    let mut time = 0.0;
    for mut column in out.columns_mut() {
        plan.weigh(time, n - 1, &mut weights);
        for (slot, signal) in column.iter_mut().zip(y.rows()) {
            *slot = weights.output(0, n, |i| signal[i]);
        }
        time += 1.0 / plan.ratio;
    }
    Ok(out)
}

/// The symmetric filter of a halving of the rate, an odd number of taps.
pub(crate) fn halving(fast: bool) -> Vec<f64> {
    let plan = SincPlan::new(2.0, 1.0, fast).expect("rates that are possible");
    let mut weights = Weights::default();
    plan.weigh(0.0, 0, &mut weights);
    // Both wings end at the same distance; the left one begins at 0.
    weights.left.iter().skip(1).rev().chain(&weights.left).copied().collect()
}

/// Converts interleaved frames as they come; the outputs do not depend on how the input is cut into
/// blocks.
#[derive(Debug, Clone)]
pub struct SincStream {
    plan: Arc<SincPlan>,
    channels: usize,
    /// Interleaved frames from number `start` on that are still needed.
    held: Vec<f32>,
    start: usize,
    given: u64,
    /// Of the next output, in input frames; summed up as resampy does.
    time: f64,
    weights: Weights,
}

impl SincStream {
    /// A stream of `channels` interleaved channels.
    ///
    /// # Errors
    /// `channels` is 0.
    pub fn new(plan: Arc<SincPlan>, channels: usize) -> Result<Self> {
        check_interleaved(channels, &[])?;
        let weights = Weights::default();
        Ok(Self { plan, channels, held: Vec::new(), start: 0, given: 0, time: 0.0, weights })
    }

    /// Takes whole interleaved frames, appends the outputs that are complete to `out`.
    ///
    /// # Errors
    /// `input` is not whole frames.
    pub fn push(&mut self, input: &[f32], out: &mut Vec<f32>) -> Result<()> {
        check_interleaved(self.channels, input)?;
        self.held.extend_from_slice(input);
        let known = self.known();
        loop {
            self.plan.weigh(self.time, usize::MAX, &mut self.weights);
            if self.weights.frame + self.weights.right.len() >= known {
                break;
            }
            self.give(out);
        }
        let needed = self.weights.frame.saturating_sub(self.plan.reach()).min(known);
        self.held.drain(..needed.saturating_sub(self.start) * self.channels);
        self.start = self.start.max(needed);
        Ok(())
    }

    /// Ends the stream: `ceil(frames * target_sr / orig_sr)` frames in all, librosa's rule, the last
    /// of which is a zero where resampy gives one less.
    pub fn finish(mut self, out: &mut Vec<f32>) {
        let known = self.known();
        while self.given < self.plan.filtered_len(known as u64) {
            self.plan.weigh(self.time, known - 1, &mut self.weights);
            self.give(out);
        }
        let total = (known as f64 * self.plan.ratio).ceil() as u64;
        out.resize(out.len() + (total - self.given) as usize * self.channels, 0.0);
    }

    /// Frames taken so far.
    fn known(&self) -> usize {
        self.start + self.held.len() / self.channels
    }

    fn give(&mut self, out: &mut Vec<f32>) {
        let Self { held, channels, start, weights, .. } = self;
        let frames = held.len() / *channels;
        out.extend(
            (0..*channels).map(|c| weights.output(*start, frames, |i| held[i * *channels + c])),
        );
        self.given += 1;
        self.time += 1.0 / self.plan.ratio;
    }
}
