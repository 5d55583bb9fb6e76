//! Scores of predicted against true classes.

use serde::Serialize;

use crate::error::Result;
use crate::table::check_labels;

/// Scores of one class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassScores {
    /// true positives / predicted; 0 when never predicted
    pub precision: f64,
    /// true positives / rows of the class; 0 without rows
    pub recall: f64,
    /// harmonic mean of the two; 0 when both are 0
    pub f1: f64,
    /// rows of the class
    pub support: usize,
}

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
    pub confusion: Vec<Vec<usize>>,
}

impl Scores {
    /// Scores of `predicted` against `truth`.
    ///
    /// # Errors
    /// Different lengths, or classes outside the table.
    pub fn new(truth: &[usize], predicted: &[usize], n_classes: usize) -> Result<Self> {
        check_labels(truth.len(), predicted, n_classes)?;
        check_labels(truth.len(), truth, n_classes)?;
        let mut confusion = vec![vec![0usize; n_classes]; n_classes];
        truth.iter().zip(predicted).for_each(|(&t, &p)| confusion[t][p] += 1);
        let ratio = |part: usize, whole: usize| {
            if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
        };
        let mut classes = Vec::with_capacity(n_classes);
        let mut seen = 0usize;
        for class in 0..n_classes {
            let hits = confusion[class][class];
            let support: usize = confusion[class].iter().sum();
            let named: usize = confusion.iter().map(|row| row[class]).sum();
            seen += usize::from(support + named > 0);
            classes.push(ClassScores {
                precision: ratio(hits, named),
                recall: ratio(hits, support),
                f1: ratio(2 * hits, support + named),
                support,
            });
        }
        let rows = truth.len();
        let hits: usize = (0..n_classes).map(|c| confusion[c][c]).sum();
        let weighted = classes.iter().map(|c| c.f1 * c.support as f64).sum::<f64>();
        Ok(Self {
            accuracy: ratio(hits, rows),
            weighted_f1: if rows == 0 { 0.0 } else { weighted / rows as f64 },
            macro_f1: classes.iter().map(|c| c.f1).sum::<f64>() / seen.max(1) as f64,
            classes,
            confusion,
        })
    }
}
