//! Late fusion: one decision from several.

use ndarray::{Array2, ArrayView2};

use crate::error::{ModelError, Result};
use crate::table::argmax;

/// Weighted mean of class probabilities `[rows, classes]` of several models.
///
/// # Errors
/// No model, different shapes, or weights that are not one positive number per model.
pub fn average(models: &[ArrayView2<'_, f64>], weights: &[f64]) -> Result<Array2<f64>> {
    let length = |what, expected, actual| Err(ModelError::Length { what, expected, actual });
    let Some(first) = models.first() else { return length("models to average", 1, 0) };
    if weights.len() != models.len() {
        return length("weights", models.len(), weights.len());
    }
    if let Some(w) = weights.iter().find(|w| !(w.is_finite() && **w > 0.0)) {
        return Err(ModelError::ParameterValue {
            owner: "average",
            key: "weights".into(),
            value: w.to_string(),
            allowed: "positive numbers".into(),
        });
    }
    if let Some(other) = models.iter().find(|m| m.nrows() != first.nrows()) {
        return length("rows to average", first.nrows(), other.nrows());
    }
    if let Some(other) = models.iter().find(|m| m.ncols() != first.ncols()) {
        return length("classes to average", first.ncols(), other.ncols());
    }
    let total: f64 = weights.iter().sum();
    let mut mean = Array2::zeros(first.dim());
    models.iter().zip(weights).for_each(|(m, w)| mean.scaled_add(w / total, m));
    Ok(mean)
}

/// The class most windows of a recording were given, the lowest among equals. `offsets` has one
/// entry more than there are recordings: recording r owns windows `offsets[r]..offsets[r + 1]`.
/// `None` for a recording without windows.
///
/// # Errors
/// Offsets that decrease or reach beyond the windows, or classes outside the table.
pub fn majority_vote(
    windows: &[usize],
    offsets: &[usize],
    n_classes: usize,
) -> Result<Vec<Option<usize>>> {
    crate::table::check_labels(windows.len(), windows, n_classes)?;
    let recordings = offsets.windows(2).map(|pair| {
        let Some(own) = windows.get(pair[0]..pair[1]) else {
            let (what, expected) = ("windows of the recordings", windows.len());
            return Err(ModelError::Length { what, expected, actual: pair[0].max(pair[1]) });
        };
        let mut votes = vec![0.0; n_classes];
        own.iter().for_each(|&class| votes[class] += 1.0);
        Ok((!own.is_empty()).then(|| argmax(&votes)))
    });
    recordings.collect()
}

/// For every row the pair (a, b) of classes with the largest product of probabilities among the
/// feasible ones, e.g. type and level where an empty container has no filling type.
///
/// # Errors
/// Different numbers of rows, no feasible pair, or a pair outside the tables.
pub fn joint_decision(
    a: ArrayView2<'_, f64>,
    b: ArrayView2<'_, f64>,
    feasible: &[(usize, usize)],
) -> Result<Vec<(usize, usize)>> {
    if a.nrows() != b.nrows() {
        let what = "rows to decide jointly";
        return Err(ModelError::Length { what, expected: a.nrows(), actual: b.nrows() });
    }
    if feasible.is_empty() {
        return Err(ModelError::Length { what: "feasible pairs", expected: 1, actual: 0 });
    }
    for (row, &(i, j)) in feasible.iter().enumerate() {
        for (class, n_classes) in [(i, a.ncols()), (j, b.ncols())] {
            if class >= n_classes {
                return Err(ModelError::ClassOutOfRange { row, class, n_classes });
            }
        }
    }
    let decide = |(a, b): (ndarray::ArrayView1<'_, f64>, ndarray::ArrayView1<'_, f64>)| {
        let products: Vec<f64> = feasible.iter().map(|&(i, j)| a[i] * b[j]).collect();
        feasible[argmax(&products)]
    };
    Ok(a.outer_iter().zip(b.outer_iter()).map(decide).collect())
}

/// Adds up the probabilities of classes that are one in another table: `into[class]` is the class
/// there, e.g. the level of each joint class.
///
/// # Errors
/// Not one entry per class, or an entry outside the new table.
pub fn merge_classes(
    proba: ArrayView2<'_, f64>,
    into: &[usize],
    n_classes: usize,
) -> Result<Array2<f64>> {
    crate::table::check_labels(proba.ncols(), into, n_classes)?;
    let mut merged = Array2::zeros((proba.nrows(), n_classes));
    for (column, &class) in proba.columns().into_iter().zip(into) {
        let mut to = merged.column_mut(class);
        to += &column;
    }
    Ok(merged)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn averages_by_weight() {
        let (a, b) = (array![[1.0, 0.0], [0.5, 0.5]], array![[0.0, 1.0], [0.0, 1.0]]);
        let mean = average(&[a.view(), b.view()], &[3.0, 1.0]).unwrap();
        assert_eq!(mean, array![[0.75, 0.25], [0.375, 0.625]]);
        assert!(average(&[a.view(), b.view()], &[1.0]).is_err());
        assert!(average(&[a.view()], &[f64::NAN]).is_err());
        assert!(average(&[], &[]).is_err());
    }

    #[test]
    fn votes_and_breaks_ties_low() {
        let found = majority_vote(&[2, 2, 1, 1, 0, 0], &[0, 3, 5, 5, 6], 3).unwrap();
        assert_eq!(found, [Some(2), Some(0), None, Some(0)]);
        assert!(majority_vote(&[0], &[0, 2], 1).is_err());
        assert!(majority_vote(&[0], &[1, 0], 1).is_err());
    }

    #[test]
    fn joint_decision_stays_feasible() {
        let (kind, level) = (array![[0.6, 0.4]], array![[0.2, 0.8]]);
        assert_eq!(joint_decision(kind.view(), level.view(), &[(0, 0), (1, 1)]).unwrap(), [(1, 1)]);
        assert!(joint_decision(kind.view(), level.view(), &[(0, 2)]).is_err());
    }

    #[test]
    fn merges_by_adding_up() {
        let merged = merge_classes(array![[0.5, 0.2, 0.3]].view(), &[0, 1, 0], 2).unwrap();
        assert_eq!(merged, array![[0.8, 0.2]]);
    }
}
