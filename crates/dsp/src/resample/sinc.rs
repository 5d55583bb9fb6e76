//! resampy 0.2.2's windowed-sinc interpolation, which librosa used up to 0.9.

use std::sync::Arc;

use rayon::prelude::*;

use super::check::{check_interleaved, check_rates};
use super::kaiser::{KaiserSinc, PRECISION, Table};
use super::kernel::SPAN;
use crate::error::{DspError, Result};
use crate::real::Real;
use crate::simd::vectorized;

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

/// Weights that are summed side by side; rows are whole multiples of the smaller.
const BLOCKS: [usize; 2] = [64, 16];

impl<T: Real> SincPlan<T> {
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
        let before = (2 * after).next_multiple_of(BLOCKS[1]) - after;
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
        let taps = self.before + self.after;
        let step = self.step();
        let mut own = vec![T::zero(); taps];
        vectorized(
            #[inline(always)]
            || {
                let mut time = time;
                for slot in out {
                    let (frame, fraction) = (time as usize, time.fract());
                    let row = match &self.weights {
                        Weights::Bank(bank) => {
                            let phase = (fraction * bank.phases as f64 + 0.5) as usize;
                            &bank.rows[phase * taps..(phase + 1) * taps]
                        }
                        _ => {
                            self.table.row(fraction, self.before, &mut own);
                            &own[..]
                        }
                    };
                    *slot = dot(row, &samples[frame - start..frame - start + taps]);
                    time += step;
                }
                time
            },
        )
    }
}

/// The smallest number of steps of equal size into which samples are cut so that every output lies
/// at the end of one, for rates of whole hertz.
fn phases(orig_sr: f64, target_sr: f64) -> Option<usize> {
    let whole = |rate: f64| (rate.fract() == 0.0 && rate < 2f64.powi(53)).then_some(rate as u64);
    let (orig, target) = (whole(orig_sr)?, whole(target_sr)?);
    let (mut a, mut b) = (orig, target);
    while b > 0 {
        (a, b) = (b, a % b);
    }
    usize::try_from(target / a).ok()
}

/// Sum of products, in an order that does not depend on the vector unit. The lengths are equal and a
/// multiple of the smaller of [`BLOCKS`].
#[inline(always)]
fn dot<T: Real>(weights: &[T], samples: &[T]) -> T {
    const WIDE: usize = BLOCKS[0];
    const NARROW: usize = BLOCKS[1];
    let mut sums = [T::zero(); WIDE];
    let (wide, rest) = weights.as_chunks::<WIDE>();
    let (wide_samples, rest_samples) = samples.as_chunks::<WIDE>();
    for (w, x) in wide.iter().zip(wide_samples) {
        for (sum, (w, x)) in sums.iter_mut().zip(w.iter().zip(x)) {
            *sum = w.mul_add(*x, *sum);
        }
    }
    for (w, x) in rest.as_chunks::<NARROW>().0.iter().zip(rest_samples.as_chunks::<NARROW>().0) {
        for (sum, (w, x)) in sums.iter_mut().zip(w.iter().zip(x)) {
            *sum = w.mul_add(*x, *sum);
        }
    }
    let mut half = WIDE / 2;
    while half > 0 {
        for i in 0..half {
            let other = sums[i + half];
            sums[i] += other;
        }
        half /= 2;
    }
    sums[0]
}

/// Outputs that are summed side by side.
const SIDE: usize = 64;

/// Every output `o` is the sum of the samples from `o * down` on by `taps`, as resampy sums: from tap
/// `before - 1` down to the first, then from tap `before` up, rounded at every step.
fn decimate<T: Real>(samples: &[T], taps: &[f64], before: usize, down: usize, out: &mut [T]) {
    // Samples that meet the same tap lie side by side, with room for the last outputs.
    let room = samples.len().div_ceil(down) + SIDE;
    let mut planes = vec![0.0; down * room];
    for (m, plane) in planes.chunks_exact_mut(room).enumerate() {
        let part = samples.iter().skip(m).step_by(down);
        plane.iter_mut().zip(part).for_each(|(slot, x)| *slot = x.wide());
    }
    let outwards = (0..before).rev().chain(before..taps.len());
    let weighed: Vec<(f64, usize)> = outwards
        .map(|k| (taps[k], k % down * room + k / down))
        .filter(|(weight, _)| *weight != 0.0)
        .collect();
    vectorized(
        #[inline(always)]
        || {
            for (i, out) in out.chunks_mut(SIDE).enumerate() {
                let mut sums = [T::zero(); SIDE];
                for &(weight, at) in &weighed {
                    let samples = &planes[i * SIDE + at..][..SIDE];
                    for (sum, x) in sums.iter_mut().zip(samples) {
                        *sum = T::of(sum.wide() + weight * x);
                    }
                }
                out.copy_from_slice(&sums[..out.len()]);
            }
        },
    );
}

/// `y`, channels of `n` samples one after another, at another rate: channels of
/// [`SincPlan::filtered_len`] samples, into `out`.
pub(super) fn resample_sinc<T: Real>(y: &[T], n: usize, plan: &SincPlan<T>, out: &mut [T]) {
    let length = plan.filtered_len(n as u64) as usize;
    if length == 0 {
        return;
    }
    // Times are sums of steps: those of the spans' first outputs, in order.
    let mut time = 0.0;
    let starts: Vec<f64> = (0..length)
        .filter_map(|o| {
            let start = o.is_multiple_of(SPAN).then_some(time);
            time += plan.step();
            start
        })
        .collect();
    let padded: Vec<Vec<T>> = y
        .chunks_exact(n)
        .map(|signal| {
            // A sum of steps may end a little after the last sample.
            let mut samples = vec![T::zero(); plan.before + n + plan.after];
            samples[plan.before - 1..][..n].copy_from_slice(signal);
            samples
        })
        .collect();
    let spans: Vec<_> = out
        .chunks_exact_mut(length)
        .zip(&padded)
        .flat_map(|(row, samples)| {
            let spans = row.chunks_mut(SPAN).zip(&starts);
            spans.map(move |(out, start)| (out, samples, *start))
        })
        .collect();
    spans.into_par_iter().for_each(|(out, samples, start)| {
        plan.run(samples, 0, start, out);
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
            held.extend(input.iter().skip(c).step_by(channels));
        }
        let complete = self.known().saturating_sub(self.plan.after);
        let (mut time, mut count) = (self.time, 0);
        while (time as usize) < complete {
            time += self.plan.step();
            count += 1;
        }
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
