//! What every classifier and step asks of a feature table and its labels.

use ndarray::{ArrayView2, Axis};
use rayon::prelude::*;

use crate::error::{ModelError, Result};

/// Refuses an empty table and anything that is not finite.
pub(crate) fn check_features(x: ArrayView2<'_, f64>) -> Result<()> {
    if x.nrows() == 0 || x.ncols() == 0 {
        return Err(ModelError::Empty { rows: x.nrows(), features: x.ncols() });
    }
    // The sum is finite unless something is not (or the sum itself overflows): a quick first look.
    if x.axis_iter(Axis(0)).into_par_iter().map(|row| row.sum()).sum::<f64>().is_finite() {
        return Ok(());
    }
    match x.indexed_iter().find(|(_, v)| !v.is_finite()) {
        Some(((row, feature), &value)) => Err(ModelError::NonFinite { row, feature, value }),
        None => Ok(()),
    }
}

/// Refuses rows that are all the same: there is nothing to tell classes apart by.
pub(crate) fn check_varied(x: ArrayView2<'_, f64>) -> Result<()> {
    let (rows, features) = x.dim();
    if rows < 2 || x.outer_iter().skip(1).any(|row| row != x.row(0)) {
        return Ok(());
    }
    Err(ModelError::ConstantFeature { feature: 0, rows, count: features, features })
}

/// Refuses features that are not those the model was trained on, by number, and non-finite ones.
pub(crate) fn check_query(x: ArrayView2<'_, f64>, n_features: usize) -> Result<()> {
    if x.ncols() != n_features {
        return Err(ModelError::Length {
            what: "features per row",
            expected: n_features,
            actual: x.ncols(),
        });
    }
    if x.nrows() == 0 { Ok(()) } else { check_features(x) }
}

/// Refuses labels that do not go with the rows or lie outside the label table.
pub(crate) fn check_labels(rows: usize, y: &[usize], n_classes: usize) -> Result<()> {
    if y.len() != rows {
        return Err(ModelError::Length { what: "labels", expected: rows, actual: y.len() });
    }
    match y.iter().enumerate().find(|(_, c)| **c >= n_classes) {
        Some((row, &class)) => Err(ModelError::ClassOutOfRange { row, class, n_classes }),
        None => Ok(()),
    }
}

/// Refuses weights that do not go with the rows, are negative or not finite.
pub(crate) fn check_weights(rows: usize, weights: &[f64]) -> Result<()> {
    if weights.len() != rows {
        let (expected, actual) = (rows, weights.len());
        return Err(ModelError::Length { what: "sample weights", expected, actual });
    }
    match weights.iter().enumerate().find(|(_, w)| !(w.is_finite() && **w >= 0.0)) {
        Some((row, &value)) => Err(ModelError::SampleWeight { row, value }),
        None => Ok(()),
    }
}

/// Rows per class.
pub(crate) fn class_counts(y: &[usize], n_classes: usize) -> Vec<usize> {
    let mut counts = vec![0; n_classes];
    y.iter().for_each(|&c| counts[c] += 1);
    counts
}

/// Index of the largest value, the first one among equals.
pub fn argmax<'a>(values: impl IntoIterator<Item = &'a f64>) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (i, &v) in values.into_iter().enumerate() {
        if v > best.1 {
            best = (i, v);
        }
    }
    best.0
}
