//! The two-class problems solved by linfa-svm, one class against one.
//!
//! linfa-svm holds the whole kernel matrix of a pair of classes in double precision, so the size is
//! checked first. Its solution has the form of ours: support vectors, coefficients, threshold.

use linfa::DatasetBase;
use linfa::traits::Fit;
use ndarray::{Array1, ArrayView2, Axis};

use super::kernel::Function;
use crate::error::{ModelError, Result};
use crate::table::class_counts;

/// Most memory for the kernel matrix of a pair of classes.
const MAX_KERNEL_BYTES: usize = 1 << 30;

/// Coefficients that linfa-svm itself takes for zero.
const ZERO: f64 = 100.0 * f64::EPSILON;

/// The machine of two classes; the first is on the positive side.
pub(super) struct Solved {
    pub first: usize,
    pub second: usize,
    /// training rows that are support vectors
    pub rows: Vec<u32>,
    /// α·y of each
    pub coefficients: Vec<f64>,
    pub rho: f64,
}

/// The machines of every two classes. `costs` are the factors of the classes' slack, `tol` the
/// tolerance of the optimality conditions.
pub(super) fn train(
    x: ArrayView2<'_, f64>,
    y: &[usize],
    costs: &[f64],
    function: Function,
    tol: f64,
) -> Result<Vec<Solved>> {
    let n_classes = costs.len();
    let failed = |reason: String| ModelError::Numerical { owner: "svm", reason };
    let mut counts = class_counts(y, n_classes);
    counts.sort_unstable_by(|a, b| b.cmp(a));
    let most: usize = counts.iter().take(2).sum();
    if most.saturating_mul(most).saturating_mul(size_of::<f64>()) > MAX_KERNEL_BYTES {
        return Err(failed(format!(
            "the two largest classes have {most} rows, and solver = linfa keeps all their kernel \
             values in memory, so it takes at most {} rows; use solver = own",
            MAX_KERNEL_BYTES.div_euclid(size_of::<f64>()).isqrt()
        )));
    }
    let mut pairs = Vec::new();
    for first in 0..n_classes {
        for second in first + 1..n_classes {
            let rows: Vec<usize> =
                (0..y.len()).filter(|&row| y[row] == first || y[row] == second).collect();
            let positive: Array1<bool> = rows.iter().map(|&row| y[row] == first).collect();
            let data = DatasetBase::new(x.select(Axis(0), &rows), positive);
            let solver = linfa_svm::Svm::<f64, bool>::params()
                .pos_neg_weights(costs[first], costs[second])
                .eps(tol);
            // linfa's width is the reciprocal of gamma.
            let solver = match function {
                Function::Rbf { gamma } => solver.gaussian_kernel(1.0 / gamma),
                Function::Linear => solver.linear_kernel(),
            };
            let solved = solver.fit(&data).map_err(|e| failed(format!("linfa-svm: {e}")))?;
            if !solved.rho.is_finite() || !solved.alpha.iter().all(|a| a.is_finite()) {
                return Err(failed(
                    "linfa-svm found no finite solution: standardise the features".into(),
                ));
            }
            let kept = rows.iter().zip(&solved.alpha).filter(|(_, alpha)| alpha.abs() > ZERO);
            let (rows, coefficients) = kept.map(|(&row, &alpha)| (row as u32, alpha)).unzip();
            let rho = solved.rho;
            pairs.push(Solved { first, second, rows, coefficients, rho });
        }
    }
    Ok(pairs)
}
