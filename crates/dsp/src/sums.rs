//! Sums over slices in independent lanes: as accurate as one running sum, without its latency.

use num_traits::Zero;
use std::ops::AddAssign;

const LANES: usize = 8;

/// Sum of `term(x)` over `values`.
#[inline]
pub(crate) fn sum<T: Copy>(values: &[T], term: impl Fn(T) -> f64) -> f64 {
    sum_pairs(values, values, |x, _| term(x))
}

/// Sum of `term(x, w)` over pairs; the shorter slice ends it.
#[inline]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_is_summed_once() {
        for n in 0..40_usize {
            let x: Vec<f64> = (0..n).map(|i| i as f64).collect();
            assert_eq!(sum(&x, |x| x), (n * n.saturating_sub(1) / 2) as f64);
            assert_eq!(sum_pairs(&x, &vec![2.0; n + 3], |x, w| x * w), 2.0 * sum(&x, |x| x));
        }
    }
}
