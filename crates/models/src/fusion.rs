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
    if !total.is_finite() {
        return Err(ModelError::ParameterValue {
            owner: "average",
            key: "weights".into(),
            value: format!("a sum of {total}"),
            allowed: "positive numbers with a finite sum".into(),
        });
    }
    let mut mean = Array2::zeros(first.dim());
    models.iter().zip(weights).for_each(|(m, w)| mean.scaled_add(w / total, m));
    Ok(mean)
}

/// Windows of one recording, counted as they come, so that their number costs no memory.
#[derive(Clone, Debug)]
pub struct WindowVotes {
    counts: Vec<usize>,
    /// sums of probabilities; `None` once a window had none
    sums: Option<Vec<f64>>,
}

/// A class of windows in which nothing happens: it wins only where no other class has enough
/// windows. With 6 windows of `none` that is how M4 decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Background {
    /// the class
    pub class: usize,
    /// windows that another class needs
    pub least: usize,
}

impl WindowVotes {
    /// No windows yet.
    pub fn new(n_classes: usize) -> Self {
        Self { counts: vec![0; n_classes], sums: Some(vec![0.0; n_classes]) }
    }

    /// Adds a window: its class and, where the classifier has them, its probabilities.
    ///
    /// # Errors
    /// A class outside the table, or not one probability per class.
    pub fn add(&mut self, class: usize, proba: Option<&[f64]>) -> Result<()> {
        crate::table::check_labels(1, &[class], self.counts.len())?;
        if let Some(proba) = proba.filter(|p| p.len() != self.counts.len()) {
            let (what, expected) = ("probabilities of a window", self.counts.len());
            return Err(ModelError::Length { what, expected, actual: proba.len() });
        }
        self.counts[class] += 1;
        self.sums = self.sums.take().zip(proba).map(|(mut sums, proba)| {
            sums.iter_mut().zip(proba).for_each(|(sum, p)| *sum += p);
            sums
        });
        Ok(())
    }

    /// Windows added.
    pub fn windows(&self) -> usize {
        self.counts.iter().sum()
    }

    /// The class that most windows were given, the lowest among equals; `None` without windows.
    pub fn majority(&self, background: Option<Background>) -> Option<usize> {
        let mut votes: Vec<f64> = self.counts.iter().map(|&n| n as f64).collect();
        if let Some(Background { class, least }) = background {
            let enough = |(c, n): (usize, &usize)| c != class && *n >= least;
            if self.counts.iter().enumerate().any(enough) {
                votes[class] = -1.0;
            } else {
                votes[class] = f64::INFINITY;
            }
        }
        (self.windows() > 0).then(|| argmax(&votes))
    }

    /// Share of windows of each class; zero without windows.
    pub fn shares(&self) -> Vec<f64> {
        let all = self.windows().max(1) as f64;
        self.counts.iter().map(|&n| n as f64 / all).collect()
    }

    /// Mean probabilities; `None` without windows, or where some window had none.
    pub fn mean(&self) -> Option<Vec<f64>> {
        let all = self.windows() as f64;
        let sums = self.sums.as_ref().filter(|_| all > 0.0)?;
        Some(sums.iter().map(|sum| sum / all).collect())
    }
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
        assert!(average(&[a.view(), b.view()], &[1e308, 1e308]).is_err());
        assert!(average(&[], &[]).is_err());
    }

    fn votes(classes: &[usize], n_classes: usize) -> WindowVotes {
        let mut votes = WindowVotes::new(n_classes);
        classes.iter().for_each(|&class| votes.add(class, None).unwrap());
        votes
    }

    #[test]
    fn votes_and_breaks_ties_low() {
        assert_eq!(votes(&[2, 2, 1], 3).majority(None), Some(2));
        assert_eq!(votes(&[1, 0], 3).majority(None), Some(0));
        assert_eq!(votes(&[], 3).majority(None), None);
        assert_eq!(votes(&[1, 0, 1, 1], 2).shares(), [0.25, 0.75]);
        assert!(votes(&[], 1).add(1, None).is_err());
        assert!(votes(&[], 2).add(1, Some(&[1.0])).is_err());
    }

    /// M4: the most frequent of the other classes where one has more than five windows, else none.
    #[test]
    fn background_gives_way_to_enough_windows_of_another_class() {
        let m4 = Some(Background { class: 0, least: 6 });
        let few = [&[0; 20][..], &[1; 5], &[2; 5]].concat();
        assert_eq!(votes(&few, 4).majority(m4), Some(0));
        let enough = [&[0; 20][..], &[1; 5], &[2; 6]].concat();
        assert_eq!(votes(&enough, 4).majority(m4), Some(2));
        assert_eq!(votes(&[1; 5], 4).majority(m4), Some(0));
    }

    #[test]
    fn means_need_probabilities_of_every_window() {
        let mut votes = WindowVotes::new(2);
        assert_eq!(votes.mean(), None);
        votes.add(0, Some(&[0.75, 0.25])).unwrap();
        votes.add(1, Some(&[0.25, 0.75])).unwrap();
        assert_eq!(votes.mean(), Some(vec![0.5, 0.5]));
        votes.add(1, None).unwrap();
        assert_eq!((votes.mean(), votes.windows()), (None, 3));
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
