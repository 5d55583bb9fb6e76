//! Sums and extremes over slices in independent lanes: as accurate as one running sum, without its
//! latency. Inlined everywhere, so that [`vectorized`](crate::simd::vectorized) reaches them.

use num_traits::Zero;
use std::ops::{AddAssign, Mul};

const LANES: usize = 8;

/// Sum of `term(x)` over `values`.
#[inline(always)]
pub(crate) fn sum<T: Copy>(values: &[T], term: impl Fn(T) -> f64) -> f64 {
    sum_pairs(values, values, |x, _| term(x))
}

/// Sum of `term(x, w)` over pairs; the shorter slice ends it.
#[inline(always)]
pub(crate) fn sum_pairs<T: Copy, W: Copy, A: Zero + Copy + AddAssign>(
    values: &[T],
    weights: &[W],
    term: impl Fn(T, W) -> A,
) -> A {
    let n = values.len().min(weights.len());
    let (values, weights) = (&values[..n], &weights[..n]);
    let (xs, ws) = (values.chunks_exact(LANES), weights.chunks_exact(LANES));
    let mut total = A::zero();
    for (x, w) in xs.remainder().iter().zip(ws.remainder()) {
        total += term(*x, *w);
    }
    let mut lanes = [A::zero(); LANES];
    for (x, w) in xs.zip(ws) {
        for ((lane, x), w) in lanes.iter_mut().zip(x).zip(w) {
            *lane += term(*x, *w);
        }
    }
    lanes.iter().for_each(|lane| total += *lane);
    total
}

/// Smallest and largest `term(x)` over `values`, infinities where there are none.
#[inline(always)]
pub(crate) fn extremes<T: Copy>(values: &[T], term: impl Fn(T) -> f64) -> (f64, f64) {
    let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
    let blocks = values.chunks_exact(LANES);
    let rest = blocks.remainder();
    for block in blocks.chain([rest]) {
        for ((low, high), x) in low.iter_mut().zip(&mut high).zip(block) {
            let x = term(*x);
            *low = if x < *low { x } else { *low };
            *high = if x > *high { x } else { *high };
        }
    }
    (low.into_iter().fold(low[0], f64::min), high.into_iter().fold(high[0], f64::max))
}

/// Largest of non-negative `values`; NaN does not count.
#[inline(always)]
pub(crate) fn largest<T: Zero + Copy + PartialOrd>(values: &[T]) -> T {
    let mut lanes = [T::zero(); 2 * LANES];
    let blocks = values.chunks_exact(2 * LANES);
    let rest = blocks.remainder();
    for block in blocks.chain([rest]) {
        for (lane, x) in lanes.iter_mut().zip(block) {
            *lane = if *x > *lane { *x } else { *lane };
        }
    }
    lanes.into_iter().fold(T::zero(), |max, x| if x > max { x } else { max })
}

/// Sums of the products of `values` with each of `rows`, each as [`sum_pairs`] takes it. Together
/// they hide the latency of one another.
#[inline(always)]
pub(crate) fn dots<const N: usize, T: Zero + Copy + AddAssign + Mul<Output = T>>(
    rows: [&[T]; N],
    values: &[T],
) -> [T; N] {
    let rows = rows.map(|row| &row[..values.len()]);
    let mut lanes = [[T::zero(); LANES]; N];
    let whole = values.len() / LANES * LANES;
    for (i, x) in values.chunks_exact(LANES).enumerate() {
        for (lanes, row) in lanes.iter_mut().zip(&rows) {
            let row = &row[i * LANES..(i + 1) * LANES];
            for ((lane, w), x) in lanes.iter_mut().zip(row).zip(x) {
                *lane += *w * *x;
            }
        }
    }
    let mut totals = [T::zero(); N];
    for ((total, lanes), row) in totals.iter_mut().zip(&lanes).zip(&rows) {
        for (w, x) in row[whole..].iter().zip(&values[whole..]) {
            *total += *w * *x;
        }
        lanes.iter().for_each(|lane| *total += *lane);
    }
    totals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_is_summed_once() {
        for n in 0..40_usize {
            let x: Vec<f64> = (0..n).map(|i| i as f64).collect();
            assert_eq!(sum(&x, |x| x), (n * n.saturating_sub(1) / 2) as f64);
            assert_eq!(sum_pairs(&x, &vec![2.0; n + 3], |x, w| x * w), 2.0 * sum(&x, |x| x));
            let turned = |x: f64| (n as f64 / 3.0 - x).abs();
            let (low, high) = extremes(&x, turned);
            let sorted = x.iter().map(|x| turned(*x));
            assert_eq!(low, sorted.clone().fold(f64::INFINITY, f64::min));
            assert_eq!(high, sorted.fold(f64::NEG_INFINITY, f64::max));
            let squares: Vec<f64> = x.iter().map(|x| turned(*x).powi(2)).collect();
            assert_eq!(largest(&squares), squares.iter().copied().fold(0.0, f64::max));
            let want = [&x, &squares].map(|row| sum_pairs(row, &x, |w, x| w * x));
            assert_eq!(dots([&x, &squares], &x), want);
        }
    }
}
