//! Mean and peak of a whole signal, as pyAudioAnalysis takes them off.

use super::Peak;
use crate::real::Real;
use crate::simd::vectorized;
use crate::sums::extremes;

/// What the whole signal decides: counts become `(count / 32768 - mean) / peak`.
pub(super) struct Level {
    mean: f64,
    /// A little more than the largest magnitude.
    peak: f64,
}

impl Level {
    pub fn of<T: Real>(y: &[T], count: impl Fn(T) -> f64 + Copy, peak: Peak) -> Self {
        let sample = |v: T| count(v) / 32768.0;
        let mean = pairwise_sum(y, sample) / y.len() as f64;
        let (low, high) = vectorized(
            #[inline(always)]
            || extremes(y, sample),
        );
        // Rounding keeps the order: the largest magnitude belongs to one of the two.
        let peak = match peak {
            Peak::Centred => (high - mean).abs().max((low - mean).abs()),
            Peak::Raw => high.abs().max(low.abs()),
        };
        Self { mean, peak: peak + 1e-10 }
    }

    pub fn apply<T: Real>(&self, y: &[T], count: impl Fn(T) -> f64, out: &mut [f64]) {
        vectorized(
            #[inline(always)]
            || {
                for (out, v) in out.iter_mut().zip(y) {
                    *out = (count(*v) / 32768.0 - self.mean) / self.peak;
                }
            },
        );
    }
}

/// Independent sums of numpy's summation.
const SUMS: usize = 8;

/// Sum in numpy's order, which decides what a constant signal leaves after its mean is taken off.
fn pairwise_sum<T: Real>(x: &[T], value: impl Fn(T) -> f64 + Copy) -> f64 {
    if x.len() < SUMS {
        return x.iter().map(|v| value(*v)).sum();
    }
    if x.len() > 128 {
        let half = x.len() / 2 / SUMS * SUMS;
        return pairwise_sum(&x[..half], value) + pairwise_sum(&x[half..], value);
    }
    vectorized(
        #[inline(always)]
        || {
            let mut r = [0.0; SUMS];
            let (blocks, rest) = x.as_chunks::<SUMS>();
            for block in blocks {
                for (sum, v) in r.iter_mut().zip(block) {
                    *sum += value(*v);
                }
            }
            let sum = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
            rest.iter().fold(sum, |sum, v| sum + value(*v))
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairwise_order() {
        let x: Vec<f64> = (0..1000).map(|i| 1.0 / (i as f64 + 1.0)).collect();
        assert!((pairwise_sum(&x, |v| v) - 7.485470860550345).abs() < 1e-14);
    }
}
