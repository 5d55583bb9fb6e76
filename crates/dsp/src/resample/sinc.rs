//! resampy 0.2.2's windowed-sinc interpolation, which librosa used up to 0.9.

use std::sync::Arc;

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::check::{check_interleaved, check_rates};
use super::common;
use super::dot::{BLOCK, dot};
use super::kaiser::{KaiserSinc, PRECISION, Table};
use super::kernel::SPAN;
use super::rounded::decimate;
use super::strided::strided;
use crate::error::{DspError, Result};
use crate::stft::PadMode;
use crate::vector::Lane;

/// Most weights of a [`Bank`].
const MAX_BANK: usize = 1 << 20;

/// The weights of every output that a ratio of whole numbers has.
#[derive(Debug, Clone)]
struct Bank<T> {
    /// Outputs lie at multiples of `1 / phases` of a sample.
    phases: usize,
    /// `[phases + 1][taps]`. The last row is that of an output whose time the sum of steps has left
    /// just before a sample: resampy weighs the samples around it from there, with another result
    /// than at the sample, as it rounds the steps through its table.
    rows: Vec<T>,
}

/// The filters that convert one rate to another as resampy's `kaiser_best` or `kaiser_fast`, in the
/// precision `T`.
///
/// They serve a whole array ([`resample`](super::resample)) and a stream ([`SincStream`]) with the
/// same bits. Where the rate falls to a whole part, the bits are resampy's: products in double
/// precision, a sum that is rounded to `T` at every sample. For other ratios all of it runs in `T`,
/// which agrees to about 1e-7 of the largest sample.
#[derive(Debug, Clone)]
pub struct SincPlan<T = f32> {
    ratio: f64,
    table: Table,
    /// Samples up to the output, and after it, that have weights.
    before: usize,
    after: usize,
    weights: Weights<T>,
}

#[derive(Debug, Clone)]
enum Weights<T> {
    /// Every output lies at a sample, so many after the one before.
    Same {
        down: usize,
        taps: Vec<f64>,
    },
    Bank(Bank<T>),
    /// Too many phases to hold.
    Any,
}

impl<T: Lane> SincPlan<T> {
    /// Makes the filters; `fast` for `kaiser_fast`.
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
        let table = Table { half: KaiserSinc::shared(fast), scale, stride };
        let after = table.reach();
        let before = (2 * after).next_multiple_of(BLOCK) - after;
        let taps = before + after;
        let phases = phases(orig_sr, target_sr)
            .filter(|phases| phases.saturating_add(1).saturating_mul(taps) <= MAX_BANK);
        let step = 1.0 / ratio;
        let weights = match phases {
            // The sum of steps is exact then.
            Some(1) if step.fract() == 0.0 => {
                let mut row = vec![0.0; taps];
                table.row(0.0, before, &mut row);
                Weights::Same { down: step as usize, taps: row }
            }
            Some(phases) => {
                let mut rows = vec![T::zero(); (phases + 1) * taps];
                for (p, row) in rows.chunks_exact_mut(taps).enumerate() {
                    table.row(p as f64 / phases as f64, before, row);
                }
                Weights::Bank(Bank { phases, rows })
            }
            None => Weights::Any,
        };
        Ok(Self { ratio, table, before, after, weights })
    }

    /// Samples that `n` samples become: the whole ones.
    pub(super) fn filtered_len(&self, n: u64) -> u64 {
        (n as f64 * self.ratio) as u64
    }

    /// Frames from one output to the next.
    fn step(&self) -> f64 {
        1.0 / self.ratio
    }

    /// Outputs from the one at `time` on that lie before frame `end`.
    fn outputs_before(&self, end: usize, mut time: f64) -> usize {
        if let Weights::Same { down, .. } = &self.weights {
            return end.saturating_sub(time as usize).div_ceil(*down);
        }
        let mut count = 0;
        while (time as usize) < end {
            time += self.step();
            count += 1;
        }
        count
    }

    /// Outputs from the one at `time` on, in frames; the time of the next one. `samples` begin
    /// `before - 1` frames before frame `start` and cover all that the outputs depend on.
    fn run(&self, samples: &[T], start: usize, time: f64, out: &mut [T]) -> f64 {
        if out.is_empty() {
            return time;
        }
        if let Weights::Same { down, taps } = &self.weights {
            let from = time as usize - start;
            let samples = &samples[from..from + (out.len() - 1) * down + taps.len()];
            decimate(samples, taps, self.before, *down, out);
            return time + (out.len() * down) as f64;
        }
        Arch::new().dispatch(Weigh { plan: self, samples, start, time, out })
    }
}

/// [`SincPlan::run`] for outputs between samples.
struct Weigh<'a, T> {
    plan: &'a SincPlan<T>,
    samples: &'a [T],
    start: usize,
    time: f64,
    out: &'a mut [T],
}

impl<T: Lane> WithSimd for Weigh<'_, T> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { plan, samples, start, mut time, out } = self;
        let (step, taps) = (plan.step(), plan.before + plan.after);
        let mut own = vec![T::zero(); taps];
        for slot in out {
            let (frame, fraction) = (time as usize, time.fract());
            let row = match &plan.weights {
                Weights::Bank(bank) => {
                    let phase = (fraction * bank.phases as f64 + 0.5) as usize;
                    &bank.rows[phase * taps..(phase + 1) * taps]
                }
                _ => {
                    plan.table.row(fraction, plan.before, &mut own);
                    &own[..]
                }
            };
            *slot = dot(simd, row, &samples[frame - start..frame - start + taps]);
            time += step;
        }
        time
    }
}

/// The smallest number of steps of equal size into which samples are cut so that every output lies
/// at the end of one, for rates of whole hertz.
fn phases(orig_sr: f64, target_sr: f64) -> Option<usize> {
    let whole = |rate: f64| (rate.fract() == 0.0 && rate < 2f64.powi(53)).then_some(rate as u64);
    let (orig, target) = (whole(orig_sr)?, whole(target_sr)?);
    usize::try_from(u128::from(target) / common(orig.into(), target.into())).ok()
}

/// `y`, channels of `n` samples one after another, at another rate into `rows`: of
/// [`SincPlan::filtered_len`] samples, the first ones or all.
pub(super) fn resample_sinc<'a, T: Lane>(
    y: &[T],
    n: usize,
    plan: &SincPlan<T>,
    rows: impl Iterator<Item = &'a mut [T]>,
) {
    let length = plan.filtered_len(n as u64) as usize;
    // Times are sums of steps: those of the spans' first outputs, in order.
    let mut time = 0.0;
    let starts: Vec<f64> = (0..length)
        .filter_map(|o| {
            let start = o.is_multiple_of(SPAN).then_some(time);
            time += plan.step();
            start
        })
        .collect();
    let spans: Vec<_> = rows
        .zip(y.chunks_exact(n))
        .flat_map(|(row, signal)| {
            let spans = row.chunks_mut(SPAN).zip(&starts);
            spans.map(move |(out, start)| (out, signal, *start))
        })
        .collect();
    spans.into_par_iter().for_each(|(out, signal, time)| {
        let start = time as usize;
        // The sum of steps may end a little after their product.
        let last = (time + out.len() as f64 * plan.step()) as usize + 1;
        let from = start as isize - (plan.before as isize - 1);
        let needed = last + plan.after - start + plan.before - 1;
        let inside = usize::try_from(from).ok().and_then(|from| signal.get(from..from + needed));
        match inside {
            Some(samples) => plan.run(samples, start, time, out),
            None => {
                let mut samples = vec![T::zero(); needed];
                PadMode::Constant.read(signal, from, &mut samples);
                plan.run(&samples, start, time, out)
            }
        };
    });
}

/// Converts interleaved frames as they come; the outputs do not depend on how the input is cut into
/// blocks.
#[derive(Debug, Clone)]
pub struct SincStream {
    plan: Arc<SincPlan>,
    /// The samples of each channel that are still needed, from `before - 1` frames before frame
    /// `start` on.
    held: Vec<Vec<f32>>,
    start: usize,
    given: u64,
    /// Of the next output, in input frames; summed up as resampy does.
    time: f64,
}

impl SincStream {
    /// A stream of `channels` interleaved channels.
    ///
    /// # Errors
    /// `channels` is 0.
    pub fn new(plan: Arc<SincPlan>, channels: usize) -> Result<Self> {
        check_interleaved(channels, &[])?;
        let held = vec![vec![0.0; plan.before - 1]; channels];
        Ok(Self { plan, held, start: 0, given: 0, time: 0.0 })
    }

    /// Takes whole interleaved frames, appends the outputs that are complete to `out`.
    ///
    /// # Errors
    /// `input` is not whole frames.
    pub fn push(&mut self, input: &[f32], out: &mut Vec<f32>) -> Result<()> {
        let channels = self.held.len();
        check_interleaved(channels, input)?;
        for (c, held) in self.held.iter_mut().enumerate() {
            let from = held.len();
            held.resize(from + input.len() / channels, 0.0);
            strided(input, c, channels, &mut held[from..], |x| x);
        }
        let complete = self.known().saturating_sub(self.plan.after);
        let count = self.plan.outputs_before(complete, self.time);
        self.give(count, out);
        let spent = (self.time as usize).min(self.known()) - self.start;
        self.held.iter_mut().for_each(|held| drop(held.drain(..spent)));
        self.start += spent;
        Ok(())
    }

    /// Ends the stream: `ceil(frames * target_sr / orig_sr)` frames in all, librosa's rule, the last
    /// of which is a zero where resampy gives one less.
    pub fn finish(mut self, out: &mut Vec<f32>) {
        let known = self.known();
        let zeros = self.plan.after + 1;
        self.held.iter_mut().for_each(|held| held.resize(held.len() + zeros, 0.0));
        let filtered = self.plan.filtered_len(known as u64).max(self.given);
        self.give((filtered - self.given) as usize, out);
        let total = (known as f64 * self.plan.ratio).ceil() as u64;
        let missing = total.saturating_sub(self.given) as usize;
        out.resize(out.len() + missing * self.held.len(), 0.0);
    }

    /// Frames taken so far.
    fn known(&self) -> usize {
        self.start + self.held[0].len() + 1 - self.plan.before
    }

    /// Appends the next `count` outputs.
    fn give(&mut self, count: usize, out: &mut Vec<f32>) {
        let channels = self.held.len();
        let base = out.len();
        out.resize(base + count * channels, 0.0);
        let out = &mut out[base..];
        let mut time = self.time;
        if let [held] = &self.held[..] {
            time = self.plan.run(held, self.start, self.time, out);
        } else {
            let mut made = vec![0.0; count];
            for (c, held) in self.held.iter().enumerate() {
                time = self.plan.run(held, self.start, self.time, &mut made);
                let slots = out.iter_mut().skip(c).step_by(channels);
                slots.zip(&made).for_each(|(slot, v)| *slot = *v);
            }
        }
        self.time = time;
        self.given += count as u64;
    }
}
