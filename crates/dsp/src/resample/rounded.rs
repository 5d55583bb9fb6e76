//! Sums that are rounded at every step, as resampy sums: for rates that fall to a whole part.

use pulp::{Arch, Simd, WithSimd};

use super::strided::strided;
use crate::real::Real;
use crate::simd::vectorized;
use crate::sums::extremes;

/// Most outputs that are summed side by side.
const SIDE: usize = 64;
/// Where registers hold four numbers, their sixteen hold no more sums than these beside the rest.
const HALF_SIDE: usize = 32;
/// Outputs whose samples are laid out at a time: they stay in the nearest cache.
const PART: usize = 16 * SIDE;

/// Every output `o` is the sum of the samples from `o * down` on by `taps`, as resampy sums: from tap
/// `before - 1` down to the first, then from tap `before` up, rounded at every step.
pub(super) fn decimate<T: Real>(
    samples: &[T],
    taps: &[f64],
    before: usize,
    down: usize,
    out: &mut [T],
) {
    // Samples that meet the same tap lie side by side, with room for the last outputs.
    let room = PART + taps.len().div_ceil(down) + SIDE;
    let outwards = (0..before).rev().chain(before..taps.len());
    let weighed: Vec<(f64, usize)> = outwards
        .map(|k| (taps[k], k % down * room + k / down))
        .filter(|(weight, _)| *weight != 0.0)
        .collect();
    let mut planes = vec![0.0; down * room];
    for (i, out) in out.chunks_mut(PART).enumerate() {
        let samples = &samples[i * PART * down..];
        for (m, plane) in planes.chunks_exact_mut(room).enumerate() {
            strided(samples, m, down, plane, T::wide);
        }
        if !T::SINGLE {
            sum_rounded(&planes, &weighed, out, |sum| sum);
        } else if is_moderate(&planes, &weighed) {
            sum_rounded(&planes, &weighed, out, round_moderate);
        } else {
            sum_rounded(&planes, &weighed, out, |sum| T::of(sum).wide());
        }
    }
}

/// For every output the sum of `weight * planes[at + output]`, `round`ed at every step.
fn sum_rounded<T: Real>(
    planes: &[f64],
    weighed: &[(f64, usize)],
    out: &mut [T],
    round: impl Fn(f64) -> f64,
) {
    Arch::new().dispatch(SumRounded { planes, weighed, out, round });
}

struct SumRounded<'a, T, F> {
    planes: &'a [f64],
    weighed: &'a [(f64, usize)],
    out: &'a mut [T],
    round: F,
}

impl<T: Real, F: Fn(f64) -> f64> WithSimd for SumRounded<'_, T, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        if S::F64_LANES > 4 { self.by::<SIDE>() } else { self.by::<HALF_SIDE>() }
    }
}

impl<T: Real, F: Fn(f64) -> f64> SumRounded<'_, T, F> {
    #[inline(always)]
    fn by<const SIDE: usize>(self) {
        let Self { planes, weighed, out, round } = self;
        for (i, out) in out.chunks_mut(SIDE).enumerate() {
            let mut sums = [0.0; SIDE];
            for &(weight, at) in weighed {
                let samples = &planes[i * SIDE + at..][..SIDE];
                for (sum, x) in sums.iter_mut().zip(samples) {
                    *sum = round(*sum + weight * x);
                }
            }
            out.iter_mut().zip(&sums).for_each(|(slot, sum)| *slot = T::of(*sum));
        }
    }
}

/// `x` rounded to single precision and back, where that is zero or normal: adding 1.5 times the
/// 2^29-fold of its power of two leaves no room for the digits that single precision lacks. Half
/// the cost of two conversions.
#[inline(always)]
fn round_moderate(x: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    const ABOVE: f64 = 1.5 * (1_u64 << 29) as f64;
    let above = f64::from_bits(x.to_bits() & EXPONENT) * ABOVE;
    (x + above) - above
}

/// Whether no sum can leave the normal numbers of single precision, but for zero. A product of at
/// least `least` is a multiple of `least / 2^53`, and so is every sum of such, rounded or not.
fn is_moderate(planes: &[f64], weighed: &[(f64, usize)]) -> bool {
    let size = |x: f64| if x == 0.0 { f64::INFINITY } else { x.abs() };
    let ((least, _), (_, largest)) = vectorized(
        #[inline(always)]
        || (extremes(planes, size), extremes(planes, f64::abs)),
    );
    let weights = || weighed.iter().map(|(weight, _)| weight.abs());
    let (least_weight, total) = (weights().fold(f64::INFINITY, f64::min), weights().sum::<f64>());
    least * least_weight >= f64::from(f32::MIN_POSITIVE) * 2f64.powi(53)
        && largest * total < f64::from(f32::MAX)
}
