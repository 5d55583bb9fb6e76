//! Principal components (scikit-learn 1.9 `PCA(svd_solver="full")`).

use linfa_linalg::eigh::{EigSort, EighInto};
use ndarray::linalg::general_mat_mul;
use ndarray::{Array1, Array2, ArrayView2, ArrayViewMut2, Axis, s};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};
use crate::real::require_finite;

/// A fitted projection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pca {
    /// Column means of the training data `[columns]`.
    pub mean: Array1<f64>,
    /// Orthonormal directions `[components, columns]`, largest variance first. The largest entry of
    /// each is positive, which makes the signs deterministic.
    pub components: Array2<f64>,
    /// Variance along each (denominator rows - 1).
    pub explained_variance: Array1<f64>,
}

impl Pca {
    /// Fits `n_components` directions to `x [rows, columns]`.
    ///
    /// The eigenvectors come from the smaller of the two Gram matrices; directions without variance
    /// (fewer rows than components need) are completed to an orthonormal set.
    ///
    /// # Errors
    /// Fewer than two rows, `n_components` of 0 or above the smaller side, non-finite values.
    pub fn fit(x: ArrayView2<f64>, n_components: usize) -> Result<Self> {
        let (rows, columns) = x.dim();
        let most = rows.min(columns);
        if rows >= 2 && (n_components == 0 || n_components > most) {
            let allowed = format!("1 to {most}, the smaller side of X");
            return Err(DspError::parameter("n_components", n_components, allowed));
        }
        let mut eigen = Eigen::of(x)?;
        eigen.resolve(n_components)?;
        eigen.directions(n_components)
    }

    /// Fits as many directions as explain more than `part` of the variance, all of them for 1; gives
    /// the total variance too (denominator rows - 1).
    ///
    /// # Errors
    /// As [`Pca::fit`]; `part` outside 0 to 1.
    pub fn fit_explaining(x: ArrayView2<f64>, part: f64) -> Result<(Self, f64)> {
        if !(0.0..=1.0).contains(&part) {
            return Err(DspError::parameter("part of the variance", part, "0 to 1"));
        }
        let most = x.nrows().min(x.ncols());
        let mut eigen = Eigen::of(x)?;
        let (mut kept, mut total) = eigen.explaining(part);
        if kept > 0 && eigen.values[kept - 1] < eigen.values[0] * RESOLVED {
            eigen.resolve(most)?;
            (kept, total) = eigen.explaining(part);
        }
        Ok((eigen.directions(kept)?, total / (x.nrows() - 1) as f64))
    }

    /// Total variance of `x [rows, columns]` (denominator rows - 1), of which the
    /// [`explained_variance`](Self::explained_variance) of all components is the sum.
    pub fn total_variance(&self, x: ArrayView2<f64>) -> f64 {
        let squares: f64 = (&x - &self.mean).iter().map(|v| v * v).sum();
        squares / x.nrows().saturating_sub(1).max(1) as f64
    }

    /// Coordinates `[rows, components]` of `x [rows, columns]`; `whiten` divides each by its
    /// standard deviation, and makes those of directions without variance 0: what a recording has there is in no
    /// proportion to anything.
    ///
    /// # Errors
    /// Another number of columns than the fit had.
    pub fn project(&self, x: ArrayView2<f64>, whiten: bool) -> Result<Array2<f64>> {
        if x.ncols() != self.mean.len() || self.components.ncols() != self.mean.len() {
            let expected = format!("{} columns", self.mean.len());
            return Err(DspError::Shape { name: "X", expected, actual: x.shape().to_vec() });
        }
        let mut z = (&x - &self.mean).dot(&self.components.t());
        if whiten {
            let spreads = self.explained_variance.mapv(f64::sqrt);
            let largest = spreads.fold(0.0, |most: f64, &spread| most.max(spread));
            let floor = largest * self.mean.len() as f64 * ROUNDING;
            for (mut z, &spread) in z.axis_iter_mut(Axis(1)).zip(&spreads) {
                z.mapv_inplace(|z| if spread > floor { z / spread } else { 0.0 });
            }
        }
        Ok(z)
    }
}

/// Part of the largest spread, for each column, below which a spread may be rounding alone.
const ROUNDING: f64 = 100.0 * f64::EPSILON;
/// Part of the largest eigenvalue of a Gram matrix below which its eigenvectors are not resolved: rounding
/// moves them by about the precision over this.
const RESOLVED: f64 = 1e-8;
/// The same where others are computed again: what rounding moves is in the data that they leave.
const LEFT: f64 = 1e-4;

/// The centred data with the eigenvectors of the smaller of its two Gram matrices.
struct Eigen {
    mean: Array1<f64>,
    centred: Array2<f64>,
    /// Descending.
    values: Array1<f64>,
    vectors: Array2<f64>,
}

impl Eigen {
    fn of(x: ArrayView2<f64>) -> Result<Self> {
        let (rows, columns) = x.dim();
        if rows < 2 {
            let expected = "at least two rows".into();
            return Err(DspError::Shape { name: "X", expected, actual: x.shape().to_vec() });
        }
        require_finite("X", x)?;
        let mut mean = x.sum_axis(Axis(0)) / rows as f64;
        for (mean, column) in mean.iter_mut().zip(x.columns()) {
            // What rounding makes of the sum of a constant would pass for variance.
            if column.iter().all(|&value| value == column[0]) {
                *mean = column[0];
            }
        }
        let centred = &x - &mean;
        let tall = rows > columns;
        let gram = if tall { gram(centred.t()) } else { gram(centred.view()) };
        require_finite("X, squared", &gram)?;
        let (values, vectors) = eigen(gram)?;
        Ok(Self { mean, centred, values, vectors })
    }

    /// How many directions explain more than `part` of the sum of squares, and that sum.
    fn explaining(&self, part: f64) -> (usize, f64) {
        let values = self.values.mapv(|v| v.max(0.0));
        let total = values.sum();
        let mut sum = 0.0;
        let enough = values.iter().position(|v| {
            sum += v / total;
            sum > part
        });
        (enough.map_or(values.len(), |at| at + 1), total)
    }

    /// Computes again, of what the others leave of the data, eigenvectors among the first `wanted` that
    /// are too small to be resolved beside them.
    fn resolve(&mut self, wanted: usize) -> Result<()> {
        let (rows, columns) = self.centred.dim();
        let wide = if rows > columns { self.centred.t() } else { self.centred.view() };
        let floor = self.values[0] * (rows.max(columns) as f64 * f64::EPSILON).powi(2);
        let mut from = 0;
        if wanted == 0 || self.values[wanted - 1] >= self.values[0] * RESOLVED {
            return Ok(());
        }
        loop {
            let least = self.values[from] * LEFT;
            from +=
                self.values.iter().skip(from).take_while(|&&value| value >= least).count().max(1);
            if from >= wanted.min(self.values.len()) {
                return Ok(());
            }
            let rest = self.vectors.slice(s![.., from..]).to_owned();
            let (values, rotation) = eigen(gram(rest.t().dot(&wide).view()))?;
            // Rounding alone is left, of which there is nothing to resolve.
            if values[0] <= floor {
                return Ok(());
            }
            self.vectors.slice_mut(s![.., from..]).assign(&rest.dot(&rotation));
            self.values.slice_mut(s![from..]).assign(&values);
        }
    }

    /// The first directions as an orthonormal set.
    fn directions(self, n_components: usize) -> Result<Pca> {
        let Self { mean, centred, vectors, .. } = self;
        let (rows, columns) = centred.dim();
        let tall = rows > columns;
        // One product of matrices: of a matrix and one vector after another it takes twenty times as long.
        let kept = vectors.slice(s![.., ..n_components]);
        let directions = if tall { kept.t().to_owned() } else { kept.t().dot(&centred) };
        let lengths = |vectors: ArrayView2<f64>| vectors.map_axis(Axis(1), |v| v.dot(&v).sqrt());
        let spreads =
            if tall { lengths(centred.dot(&kept).t()) } else { lengths(directions.view()) };
        let mut components = Array2::<f64>::zeros((n_components, columns));
        let mut explained_variance = Array1::zeros(n_components);
        let mut largest = 0.0f64;
        for (k, (direction, &spread)) in directions.outer_iter().zip(&spreads).enumerate() {
            largest = largest.max(spread);
            let empty = spread <= largest * rows.max(columns) as f64 * f64::EPSILON;
            let unit = if empty { None } else { orthonormal(direction.to_owned(), &components, k) };
            let mut unit = match unit {
                Some(unit) => unit,
                None => completed(&components, k),
            };
            let peak = unit.iter().fold(0.0f64, |m, &v| if v.abs() > m.abs() { v } else { m });
            if peak < 0.0 {
                unit.mapv_inplace(|v| -v);
            }
            components.row_mut(k).assign(&unit);
            explained_variance[k] = spread * spread / (rows - 1) as f64;
        }
        Ok(Pca { mean, components, explained_variance })
    }
}

/// Eigenvalues, largest first, and the eigenvectors as columns.
fn eigen(gram: Array2<f64>) -> Result<(Array1<f64>, Array2<f64>)> {
    let refuse = |e| {
        let allowed = "data whose eigenvectors can be computed";
        DspError::parameter("X", format!("these ({e})"), allowed)
    };
    Ok(gram.eigh_into().map_err(refuse)?.sort_eig_desc())
}

/// `x xᵀ`. Only a half of it is computed, by all threads; its bits are those of the whole product, whose sums
/// run in the same order.
fn gram(x: ArrayView2<f64>) -> Array2<f64> {
    /// Rows of the product that are computed together.
    const ROWS: usize = 128;
    let n = x.nrows();
    let mut product = vec![0.0; n * n];
    product.par_chunks_mut((ROWS * n).max(1)).enumerate().for_each(|(block, values)| {
        let rows = values.len() / n;
        let end = block * ROWS + rows;
        let mut values = ArrayViewMut2::from_shape((rows, n), values).expect("whole rows");
        let (own, all) = (x.slice(s![end - rows..end, ..]), x.slice(s![..end, ..]));
        general_mat_mul(1.0, &own, &all.t(), 0.0, &mut values.slice_mut(s![.., ..end]));
    });
    let mut product = Array2::from_shape_vec((n, n), product).expect("a square");
    for row in 0..n {
        for column in row + 1..n {
            product[[row, column]] = product[[column, row]];
        }
    }
    product
}

/// `direction` made orthogonal to the first `k` components and of unit length; `None` if nothing is
/// left of it.
fn orthonormal(direction: Array1<f64>, components: &Array2<f64>, k: usize) -> Option<Array1<f64>> {
    let before = direction.dot(&direction).sqrt();
    let mut unit = direction;
    for _ in 0..2 {
        for row in components.outer_iter().take(k) {
            let overlap = row.dot(&unit);
            unit.scaled_add(-overlap, &row);
        }
    }
    let norm = unit.dot(&unit).sqrt();
    (norm > before * 1e-8 && norm > 0.0).then(|| unit / norm)
}

/// The first coordinate axis that the first `k` components leave room for, made orthonormal.
fn completed(components: &Array2<f64>, k: usize) -> Array1<f64> {
    let columns = components.ncols();
    (0..columns)
        .find_map(|axis| {
            let mut direction = Array1::zeros(columns);
            direction[axis] = 1.0;
            orthonormal(direction, components, k).filter(|u| u[axis].abs() > 1e-6)
        })
        .expect("k is below the number of columns, so some axis is not spanned")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(rows: usize, columns: usize) -> Array2<f64> {
        Array2::from_shape_fn((rows, columns), |(i, j)| {
            ((i * 31 + j * 17 + i * j * 7) % 101) as f64 / 50.0 - 1.0 + (i * (j + 1)) as f64 * 0.01
        })
    }

    #[test]
    fn wide_and_tall_agree_with_the_covariance() {
        for (rows, columns) in [(12, 30), (30, 12)] {
            let x = sample(rows, columns);
            let pca = Pca::fit(x.view(), 5).unwrap();
            let eye = pca.components.dot(&pca.components.t());
            for ((i, j), v) in eye.indexed_iter() {
                assert!((v - f64::from(u8::from(i == j))).abs() < 1e-12);
            }
            let z = pca.project(x.view(), false).unwrap();
            for k in 0..5 {
                let variance = z.column(k).mapv(|v| v * v).sum() / (rows - 1) as f64;
                assert!((variance / pca.explained_variance[k] - 1.0).abs() < 1e-10);
            }
            let white = pca.project(x.view(), true).unwrap();
            assert!((white.column(0).mapv(|v| v * v).sum() / (rows - 1) as f64 - 1.0).abs() < 1e-9);
        }
    }

    /// Deviations from 1 down to 1e-12 along rotated axes: below 1e-8, directions were those of rounding.
    #[test]
    fn small_directions_beside_large_ones_are_resolved() {
        for (rows, columns) in [(90, 26), (26, 90)] {
            let n = rows.min(columns);
            // Orthonormal columns of two sides, from waves, and a spread for each.
            let waves = |size: usize| {
                Array2::from_shape_fn((size, n), |(i, k)| {
                    let angle = std::f64::consts::PI * (k + 1) as f64 * (i as f64 + 0.5);
                    (2.0 / size as f64).sqrt() * (angle / size as f64).cos()
                })
            };
            let spread = |k: usize| 10f64.powf(-0.5 * k as f64);
            let kept = n - 1;
            let (left, right) = (waves(rows), waves(columns));
            let mut x = Array2::<f64>::zeros((rows, columns));
            for k in (0..kept).rev() {
                let (u, v) = (left.column(k), right.column(k));
                x += &(&u.insert_axis(Axis(1)) * &v.insert_axis(Axis(0)) * spread(k));
            }
            let pca = Pca::fit(x.view(), kept).unwrap();
            for k in 0..kept {
                let cosine = pca.components.row(k).dot(&right.column(k)).abs();
                let deviation = (pca.explained_variance[k] * (rows - 1) as f64).sqrt();
                let allowed = 1e-14 / spread(k);
                assert!((1.0 - cosine) < allowed + 1e-12, "{rows}: {k}: {cosine}");
                assert!((deviation / spread(k) - 1.0).abs() < allowed + 1e-7, "{k}: {deviation}");
            }
        }
    }

    #[test]
    fn half_a_product_has_the_bits_of_the_whole() {
        for (rows, columns) in [(2, 3), (127, 40), (300, 1000), (1000, 7)] {
            let x = sample(rows, columns);
            assert_eq!(gram(x.view()), x.dot(&x.t()), "{rows} x {columns}");
            assert_eq!(gram(x.t()), x.t().dot(&x), "{columns} x {rows}");
        }
    }

    #[test]
    fn directions_without_variance_are_completed() {
        let pca = Pca::fit(sample(4, 9).view(), 4).unwrap();
        assert!(pca.explained_variance[3] < 1e-20);
        let flat = Pca::fit(Array2::ones((3, 5)).view(), 3).unwrap();
        let eye = flat.components.dot(&flat.components.t());
        assert!((eye.diag().sum() - 3.0).abs() < 1e-12);
    }

    /// They were NaN, infinite, or as large as the inverse of rounding.
    #[test]
    fn directions_without_variance_whiten_to_0() {
        let same = Pca::fit(Array2::ones((3, 5)).view(), 3).unwrap();
        assert_eq!(same.project(sample(2, 5).view(), true).unwrap(), Array2::zeros((2, 3)));
        // Of few rows the last direction is what centring leaves.
        let few = Pca::fit(sample(4, 9).view(), 4).unwrap();
        let z = few.project(sample(5, 9).view(), true).unwrap();
        assert!(z.column(3).iter().all(|&z| z == 0.0) && z.column(2).iter().all(|&z| z != 0.0));
        // A channel that was dead in training and lives later.
        let mut dead = sample(40, 8);
        dead.slice_mut(s![.., 4..]).fill(0.0);
        let pca = Pca::fit(dead.view(), 8).unwrap();
        let z = pca.project(sample(6, 8).view(), true).unwrap();
        assert!(z.iter().all(|z| z.abs() < 100.0), "{z}");
        assert!(z.slice(s![.., 4..]).iter().all(|&z| z == 0.0));
        let mut constant = sample(10_000, 3);
        constant.column_mut(1).fill(-100.1);
        let known = Pca::fit(constant.view(), 3).unwrap();
        assert_eq!(known.mean[1], -100.1);
        let later = known.project(sample(6, 3).view(), true).unwrap();
        assert!(later.column(2).iter().all(|&z| z == 0.0), "{later}");
        // As other programs write them.
        let written =
            Pca { explained_variance: pca.explained_variance.mapv(|v| v.max(1e-48)), ..pca };
        assert_eq!(written.project(sample(6, 8).view(), true).unwrap(), z);
    }

    #[test]
    fn refusals() {
        assert!(Pca::fit(sample(1, 4).view(), 1).is_err());
        assert!(Pca::fit(sample(5, 4).view(), 5).is_err());
        let pca = Pca::fit(sample(5, 4).view(), 2).unwrap();
        assert!(pca.project(sample(2, 3).view(), false).is_err());
    }
}
