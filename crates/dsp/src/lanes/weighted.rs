//! Weighted sums of neighbouring rows.

use pulp::{Arch, Simd, WithSimd};

use super::Lanes;
use crate::real::Real;

/// For each `(first, weights)` the sum of `weights[i] * rows[first + i]` into a row of `out`.
pub fn weighted_sums<R: Lanes>(bands: &[(usize, Vec<R::Value>)], rows: &[R], out: &mut [R]) {
    Arch::new().dispatch(WeightedSums { bands, rows, out });
}

struct WeightedSums<'a, R: Lanes> {
    bands: &'a [(usize, Vec<R::Value>)],
    rows: &'a [R],
    out: &'a mut [R],
}

impl<R: Lanes> WithSimd for WeightedSums<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for ((first, weights), out) in self.bands.iter().zip(self.out) {
            let rows = &self.rows[*first..*first + weights.len()];
            for v in 0..R::registers::<S>() {
                out.store::<S>(v, band(simd, weights, rows, v));
            }
        }
    }
}

/// One sum, as four that do not wait for each other.
#[inline(always)]
fn band<R: Lanes, S: Simd>(simd: S, weights: &[R::Value], rows: &[R], v: usize) -> R::Register<S> {
    let mut sums = [R::splat(simd, R::Value::of(0.0)); 4];
    let (fours, rest) = weights.as_chunks::<4>();
    let (row_fours, row_rest) = rows.as_chunks::<4>();
    for (weights, rows) in fours.iter().zip(row_fours) {
        for i in 0..4 {
            let w = R::splat(simd, weights[i]);
            sums[i] = R::mul_add_e(simd, w, rows[i].load::<S>(v), sums[i]);
        }
    }
    for (sum, (w, row)) in sums.iter_mut().zip(rest.iter().zip(row_rest)) {
        *sum = R::mul_add_e(simd, R::splat(simd, *w), row.load::<S>(v), *sum);
    }
    let [a, b, c, d] = sums;
    R::add(simd, R::add(simd, a, b), R::add(simd, c, d))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{DoubleRow, Row};

    fn sums_of_any_length<R: Lanes>(row: impl Fn(usize) -> R) {
        let value = |i: usize| R::Value::of(i as f64);
        let rows: Vec<R> = (0..40).map(row).collect();
        let bands: Vec<(usize, Vec<R::Value>)> =
            (0..12).map(|n| (n, (0..n).map(|i| value(1 + i)).collect())).collect();
        let mut out = vec![R::EMPTY; bands.len()];
        out[0] = rows[1];
        weighted_sums(&bands, &rows, &mut out);
        for ((first, weights), out) in bands.iter().zip(&out) {
            for s in 0..R::SLOTS {
                let products = weights.iter().zip(&rows[*first..]).map(|(w, r)| *w * r.values()[s]);
                assert_eq!(out.values()[s], products.sum());
            }
        }
    }

    #[test]
    fn sums_in_both_precisions() {
        sums_of_any_length(|i| Row(std::array::from_fn(|s| (i * 7 % 11 + s) as f32)));
        sums_of_any_length(|i| DoubleRow(std::array::from_fn(|s| (i * 7 % 11 + s) as f64)));
    }
}
