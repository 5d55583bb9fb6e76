//! Confusion matrices and the scores that follow from them.

use serde::Serialize;

/// Counts of predicted against true classes; the last column counts rows without a prediction.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ConfusionMatrix {
    /// `[true class][predicted class, or the number of classes where there is none]`.
    pub counts: Vec<Vec<u64>>,
}

/// Scores of one class, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassScores {
    /// Share of the predictions of this class that are right; 0 when it is never predicted.
    pub precision: f64,
    /// Share of the rows of this class that are found; 0 without rows.
    pub recall: f64,
    /// Harmonic mean of both; 0 when both are 0.
    pub f1: f64,
    /// Number of rows of this class.
    pub support: u64,
}

impl ConfusionMatrix {
    /// Counts pairs of true class and prediction, both below `classes`; larger predictions count as
    /// none.
    pub fn new(classes: usize, pairs: impl IntoIterator<Item = (usize, Option<usize>)>) -> Self {
        let mut counts = vec![vec![0; classes + 1]; classes];
        for (truth, predicted) in pairs {
            if let Some(row) = counts.get_mut(truth) {
                row[predicted.unwrap_or(classes).min(classes)] += 1;
            }
        }
        Self { counts }
    }

    /// Number of rows counted.
    pub fn total(&self) -> u64 {
        self.counts.iter().flatten().sum()
    }

    /// Share of rows with the right class; 0 where there are none.
    pub fn accuracy(&self) -> f64 {
        self.tally().accuracy()
    }

    /// Scores of each class; 0 where a division by zero would be (as scikit-learn's default).
    pub fn classes(&self) -> Vec<ClassScores> {
        self.tally().classes()
    }

    /// Mean of the classes' F1 scores weighted by their support (scikit-learn
    /// `f1_score(average="weighted")`); rows without a prediction count as of one more class, which
    /// has no support.
    pub fn weighted_f1(&self) -> f64 {
        self.tally().weighted_f1()
    }

    /// Mean of the F1 scores of the classes that occur or are predicted (scikit-learn
    /// `f1_score(average="macro")`).
    pub fn macro_f1(&self) -> f64 {
        self.tally().macro_f1()
    }

    /// Rows without a prediction, by true class.
    pub fn unknown(&self) -> Vec<u64> {
        self.counts.iter().map(|row| row[self.counts.len()]).collect()
    }

    fn tally(&self) -> Tally {
        let classes = self.counts.len();
        let estimated = |c: usize| self.counts.iter().map(|row| row[c]).sum();
        Tally {
            right: (0..classes).map(|c| self.counts[c][c]).collect(),
            support: self.counts.iter().map(|row| row.iter().sum()).collect(),
            estimated: (0..classes).map(estimated).collect(),
        }
    }
}

/// The rows, predictions and right predictions of each class, from which all scores follow: many
/// draws of many classes are scored without a matrix.
pub(crate) struct Tally {
    right: Vec<u64>,
    support: Vec<u64>,
    estimated: Vec<u64>,
}

impl Tally {
    /// As [`ConfusionMatrix::new`].
    pub(crate) fn new(
        classes: usize,
        pairs: impl IntoIterator<Item = (usize, Option<usize>)>,
    ) -> Self {
        let none = vec![0; classes];
        let mut tally = Self { right: none.clone(), support: none.clone(), estimated: none };
        for (truth, predicted) in pairs.into_iter().filter(|(truth, _)| *truth < classes) {
            tally.support[truth] += 1;
            if let Some(predicted) = predicted.filter(|class| *class < classes) {
                tally.estimated[predicted] += 1;
                tally.right[predicted] += u64::from(predicted == truth);
            }
        }
        tally
    }

    pub(crate) fn accuracy(&self) -> f64 {
        ratio(self.right.iter().sum(), self.support.iter().sum())
    }

    fn classes(&self) -> Vec<ClassScores> {
        (0..self.right.len())
            .map(|c| {
                let (right, support, estimated) =
                    (self.right[c], self.support[c], self.estimated[c]);
                ClassScores {
                    precision: ratio(right, estimated),
                    recall: ratio(right, support),
                    f1: ratio(2 * right, support + estimated),
                    support,
                }
            })
            .collect()
    }

    pub(crate) fn weighted_f1(&self) -> f64 {
        let sum: f64 = self.classes().iter().map(|c| c.f1 * c.support as f64).sum();
        let total: u64 = self.support.iter().sum();
        if total == 0 { 0.0 } else { sum / total as f64 }
    }

    pub(crate) fn macro_f1(&self) -> f64 {
        let classes = self.classes().into_iter().zip(&self.estimated);
        let seen: Vec<f64> = classes
            .filter(|(scores, estimated)| scores.support > 0 || **estimated > 0)
            .map(|(scores, _)| scores.f1)
            .collect();
        seen.iter().sum::<f64>() / seen.len().max(1) as f64
    }
}

fn ratio(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figures from scikit-learn 1.9 `f1_score([0,0,1,1,2,2], [0,-1,1,1,0,1], average=…)`.
    #[test]
    fn agrees_with_scikit_learn() {
        let estimates = [Some(0), None, Some(1), Some(1), Some(0), Some(1)];
        let matrix = ConfusionMatrix::new(3, [0, 0, 1, 1, 2, 2].into_iter().zip(estimates));
        assert!((matrix.weighted_f1() - 13.0 / 30.0).abs() < 1e-12);
        let f1: Vec<_> = matrix.classes().iter().map(|c| c.f1).collect();
        assert_eq!(f1, [0.5, 0.8, 0.0]);
        assert_eq!(matrix.accuracy(), 0.5);
    }

    #[test]
    fn a_tally_scores_as_the_matrix_does() {
        let pairs = (0..200_usize).map(|i| (i * i % 7, (i % 11 != 0).then_some(i * 5 % 8)));
        let (tally, matrix) = (Tally::new(7, pairs.clone()), ConfusionMatrix::new(7, pairs));
        assert_eq!(tally.accuracy(), matrix.accuracy());
        assert_eq!(tally.weighted_f1(), matrix.weighted_f1());
        assert_eq!(tally.macro_f1(), matrix.macro_f1());
        assert_eq!(tally.classes(), matrix.classes());
    }

    #[test]
    fn nothing_counted_scores_zero() {
        let matrix = ConfusionMatrix::new(2, []);
        assert_eq!((matrix.weighted_f1(), matrix.accuracy()), (0.0, 0.0));
    }
}
