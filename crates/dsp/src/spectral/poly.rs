//! Polynomials fitted to spectra (librosa 0.11 `feature.poly_features`, numpy `polyfit`).

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use ndarray::Array3;

use super::{Frequencies, Spectra};
use crate::error::{DspError, Result};
use crate::real::Real;
use crate::sums;

const MAX_ORDER: usize = 256;

/// The least-squares fit of a polynomial to values at fixed frequencies: a matrix made once.
#[derive(Debug, Clone)]
pub struct Poly {
    /// Pseudo-inverse of the Vandermonde matrix, `[order + 1, bins]`, highest degree first.
    inverse: Vec<Vec<f64>>,
    rank: usize,
}

impl Poly {
    /// The fit of degree `order` at `freqs` Hz. Singular values below `bins * eps` of the largest
    /// (with columns scaled to unit length) count as zero, as in `numpy.polyfit`.
    ///
    /// # Errors
    /// `order` above 256, or powers of the frequencies that are all zero or not finite.
    pub fn new(freqs: &[f64], order: usize) -> Result<Self> {
        if order > MAX_ORDER {
            return Err(DspError::parameter("order", order, format!("0 to {MAX_ORDER}")));
        }
        let mut columns = Vec::with_capacity(order + 1);
        let mut power = vec![1.0; freqs.len()];
        for degree in 0..=order {
            columns.push(power.clone());
            power.iter_mut().zip(freqs).for_each(|(p, f)| *p *= f);
            let length = norm(&columns[degree]);
            if !(length.is_finite() && length > 0.0) {
                let allowed = format!(
                    "so small that the powers of freq stay finite and above 0 (those of {degree} do not)"
                );
                return Err(DspError::parameter("order", order, allowed));
            }
        }
        columns.reverse();
        let scales: Vec<f64> = columns.iter().map(|c| norm(c)).collect();
        for (column, scale) in columns.iter_mut().zip(&scales) {
            column.iter_mut().for_each(|x| *x /= scale);
        }
        let rotations = orthogonalise(&mut columns);
        // Now columns = U * diag(singular) and the scaled matrix is U * diag(singular) * V^T.
        let singular: Vec<f64> = columns.iter().map(|c| norm(c)).collect();
        let largest = singular.iter().fold(0.0, |m: f64, s| m.max(*s));
        let smallest = freqs.len() as f64 * f64::EPSILON * largest;
        let kept: Vec<usize> = (0..=order).filter(|j| singular[*j] > smallest).collect();
        let inverse = (0..=order)
            .map(|row| {
                let mut out = vec![0.0; freqs.len()];
                for j in &kept {
                    let factor = rotations[*j][row] / (singular[*j] * singular[*j] * scales[row]);
                    out.iter_mut().zip(&columns[*j]).for_each(|(o, u)| *o += factor * u);
                }
                out
            })
            .collect();
        Ok(Self { inverse, rank: kept.len() })
    }

    /// Number of coefficients, `order + 1`.
    pub fn rows(&self) -> usize {
        self.inverse.len()
    }

    /// Whether the frequencies cannot tell all coefficients apart (numpy's `RankWarning`).
    pub fn is_deficient(&self) -> bool {
        self.rank < self.rows()
    }

    /// Coefficients of one spectrum, highest degree first, into `out` of [`rows`](Self::rows).
    pub fn fit<T: Real>(&self, magnitude: &[T], out: &mut [f64]) {
        for (slot, row) in out.iter_mut().zip(&self.inverse) {
            *slot = sums::sum_pairs(magnitude, row, |s, w| s.wide() * w);
        }
    }
}

fn norm(column: &[f64]) -> f64 {
    sums::sum(column, |x| x * x).sqrt()
}

/// One-sided Jacobi: rotates columns until they are orthogonal and returns the rotations `V`, by
/// column, with `old columns * V = new columns`.
fn orthogonalise(columns: &mut [Vec<f64>]) -> Vec<Vec<f64>> {
    const SWEEPS: usize = 60;
    let m = columns.len();
    let unit = |j: usize| (0..m).map(|i| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
    let mut v: Vec<Vec<f64>> = (0..m).map(unit).collect();
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for i in 0..m {
            for j in i + 1..m {
                let dot = sums::sum_pairs(&columns[i], &columns[j], |a, b| a * b);
                let (a, b) = (norm(&columns[i]), norm(&columns[j]));
                if dot.abs() <= f64::EPSILON * a * b {
                    continue;
                }
                rotated = true;
                let zeta = (b - a) * (b + a) / (2.0 * dot);
                let tan = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let cos = 1.0 / tan.hypot(1.0);
                for matrix in [&mut *columns, &mut v] {
                    let (left, right) = matrix.split_at_mut(j);
                    for (x, y) in left[i].iter_mut().zip(&mut right[0]) {
                        (*x, *y) = (cos * (*x - tan * *y), cos * (tan * *x + *y));
                    }
                }
            }
        }
        if !rotated {
            break;
        }
    }
    v
}

/// Coefficients `[channels, order + 1, frames]`, highest degree first, and whether a fit was
/// [deficient](Poly::is_deficient).
///
/// # Errors
/// As [`Poly::new`], non-finite values, or frequencies that do not fit.
pub fn poly_features<'a, T: Real>(
    s: impl Into<Spectra<'a, T>>,
    freqs: Frequencies,
    order: usize,
) -> Result<(Array3<f64>, bool)> {
    let s = s.into();
    freqs.check(s.dim())?;
    s.require_finite()?;
    if let Frequencies::Bins(freqs) = freqs {
        let poly = Poly::new(freqs, order)?;
        let fit = |(): &mut (), _, _, spectrum: &[T], out: &mut [f64]| poly.fit(spectrum, out);
        let fitted = s.map(poly.rows(), || (), fit);
        return Ok((fitted, poly.is_deficient()));
    }
    let deficient = AtomicBool::new(false);
    let refused = Mutex::new(None);
    let rows = order.min(MAX_ORDER) + 1;
    let fitted = s.map(rows, Vec::new, |buffer, c, t, spectrum, out| {
        match Poly::new(freqs.column(c, t, buffer), order) {
            Ok(poly) => {
                deficient.fetch_or(poly.is_deficient(), Ordering::Relaxed);
                poly.fit(spectrum, out);
            }
            Err(error) => *refused.lock().unwrap_or_else(PoisonError::into_inner) = Some(error),
        }
    });
    let refused = refused.into_inner().unwrap_or_else(PoisonError::into_inner);
    refused.map_or(Ok((fitted, deficient.into_inner())), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_recovered() {
        let freqs: Vec<f64> = (0..513).map(|k| 21.5 * f64::from(k)).collect();
        for (order, want) in
            [(0, vec![3.0]), (2, vec![1e-6, -2e-3, 3.0]), (3, vec![0.0, 0.0, 1e-3, -1.0])]
        {
            let at = |f: &f64| want.iter().fold(0.0, |y, c| y * f + c);
            let values: Vec<f64> = freqs.iter().map(at).collect();
            let poly = Poly::new(&freqs, order).unwrap();
            let mut got = vec![0.0; order + 1];
            poly.fit(&values, &mut got);
            for (d, (g, w)) in got.iter().zip(&want).enumerate() {
                let scale = 11008.0_f64.powi((order - d) as i32);
                assert!(((g - w) * scale).abs() < 1e-10, "{order}: {got:?}");
            }
            assert!(!poly.is_deficient());
        }
    }

    #[test]
    fn fewer_points_than_coefficients_give_the_shortest_solution() {
        let poly = Poly::new(&[1.0], 1).unwrap();
        assert!(poly.is_deficient());
        let mut got = [0.0; 2];
        poly.fit(&[4.0_f32], &mut got);
        assert!((got[0] - 2.0).abs() < 1e-12 && (got[1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn powers_out_of_range_are_refused() {
        assert!(Poly::new(&[0.0], 1).is_err());
        assert!(Poly::new(&[0.0, 1e4], 100).is_err());
        assert!(Poly::new(&[0.0, 1.0], usize::MAX).is_err());
    }
}
