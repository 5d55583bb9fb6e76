//! Scores of predicted against true classes.

mod confusion;
mod curves;
mod doubts;
mod interval;
mod numeric;
mod reliability;
mod report;

use serde::Serialize;

pub(crate) use confusion::Tally;
pub use confusion::{ClassScores, ConfusionMatrix};
pub use curves::ClassCurves;
pub(crate) use doubts::check_spelling;
pub use interval::{Interval, intervals};
pub(crate) use interval::{drawn, units};
pub use numeric::{NumericScores, no_estimate};
pub use reliability::{Reliability, ReliabilityBin};
pub use report::{ClassReport, ScoreIntervals, ScoreReport, Scoring};

use crate::error::{ModelError, Result};
use crate::labels::require_few;
use crate::table::check_labels;

/// Scores of a set of predictions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scores {
    /// part of rows that are right
    pub accuracy: f64,
    /// F1 averaged with the class supports as weights (scikit-learn's `average="weighted"`)
    pub weighted_f1: f64,
    /// F1 averaged over the classes that occur or are predicted
    pub macro_f1: f64,
    /// per class
    pub classes: Vec<ClassScores>,
    /// `confusion[true][predicted]`
    pub confusion: Vec<Vec<u64>>,
    /// rows of each class without a prediction; they count as wrong
    pub unknown: Vec<u64>,
}

impl Scores {
    /// Scores of `predicted` against `truth`.
    ///
    /// # Errors
    /// Different lengths, classes outside the table, or more than [`crate::labels::MAX_CLASSES`].
    pub fn new(truth: &[usize], predicted: &[usize], n_classes: usize) -> Result<Self> {
        check_labels(truth.len(), predicted, n_classes)?;
        Self::with_unknown(truth, predicted.iter().copied().map(Some), n_classes)
    }

    /// The same where some rows may have no prediction: their class is unknown, and they are wrong.
    ///
    /// # Errors
    /// As [`Scores::new`].
    pub fn with_unknown(
        truth: &[usize],
        predicted: impl IntoIterator<Item = Option<usize>>,
        n_classes: usize,
    ) -> Result<Self> {
        // The matrix has a place for each pair of them.
        require_few(n_classes)?;
        check_labels(truth.len(), truth, n_classes)?;
        let predicted: Vec<Option<usize>> = predicted.into_iter().collect();
        if predicted.len() != truth.len() {
            let (expected, actual) = (truth.len(), predicted.len());
            return Err(ModelError::Length { what: "predictions", expected, actual });
        }
        let matrix = ConfusionMatrix::new(n_classes, truth.iter().copied().zip(predicted));
        let square = matrix.counts.iter().map(|row| row[..n_classes].to_vec()).collect();
        Ok(Self {
            accuracy: matrix.accuracy(),
            weighted_f1: matrix.weighted_f1(),
            macro_f1: matrix.macro_f1(),
            classes: matrix.classes(),
            confusion: square,
            unknown: matrix.unknown(),
        })
    }
}
