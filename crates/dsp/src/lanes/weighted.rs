//! Weighted sums of neighbouring rows.

use pulp::{Arch, Simd, WithSimd};

use super::{Row, registers};

/// For each `(first, weights)` the sum of `weights[i] * rows[first + i]` into a row of `out`.
pub fn weighted_sums(bands: &[(usize, Vec<f32>)], rows: &[Row], out: &mut [Row]) {
    Arch::new().dispatch(WeightedSums { bands, rows, out });
}

struct WeightedSums<'a> {
    bands: &'a [(usize, Vec<f32>)],
    rows: &'a [Row],
    out: &'a mut [Row],
}

impl WithSimd for WeightedSums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for ((first, weights), out) in self.bands.iter().zip(self.out) {
            let rows = &self.rows[*first..*first + weights.len()];
            for v in 0..registers::<S>() {
                out.store::<S>(v, band(simd, weights, rows, v));
            }
        }
    }
}

/// One sum, as four that do not wait for each other.
#[inline(always)]
fn band<S: Simd>(simd: S, weights: &[f32], rows: &[Row], v: usize) -> S::f32s {
    let mut sums = [simd.splat_f32s(0.0); 4];
    let (fours, rest) = weights.as_chunks::<4>();
    let (row_fours, row_rest) = rows.as_chunks::<4>();
    for (weights, rows) in fours.iter().zip(row_fours) {
        for i in 0..4 {
            let w = simd.splat_f32s(weights[i]);
            sums[i] = simd.mul_add_e_f32s(w, rows[i].load::<S>(v), sums[i]);
        }
    }
    for (sum, (w, row)) in sums.iter_mut().zip(rest.iter().zip(row_rest)) {
        *sum = simd.mul_add_e_f32s(simd.splat_f32s(*w), row.load::<S>(v), *sum);
    }
    let [a, b, c, d] = sums;
    simd.add_f32s(simd.add_f32s(a, b), simd.add_f32s(c, d))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::LANES;

    #[test]
    fn sums_of_any_length() {
        let rows: Vec<Row> =
            (0..40).map(|i| Row(std::array::from_fn(|s| (i * 7 % 11 + s) as f32))).collect();
        let bands: Vec<(usize, Vec<f32>)> =
            (0..12).map(|n| (n, (0..n).map(|i| 1.0 + i as f32).collect())).collect();
        let mut out = vec![Row([f32::NAN; LANES]); bands.len()];
        weighted_sums(&bands, &rows, &mut out);
        for ((first, weights), out) in bands.iter().zip(&out) {
            for s in 0..LANES {
                let want: f32 = weights.iter().zip(&rows[*first..]).map(|(w, r)| w * r.0[s]).sum();
                assert_eq!(out.0[s], want);
            }
        }
    }
}
