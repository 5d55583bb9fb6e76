//! What a study found.

use corsmal_plot::RecordingPicture;
use ndarray::Array2;

use crate::Fact;

/// All that is known of a study; what is empty is left out of its report.
#[derive(Clone, Debug, Default)]
pub struct Study {
    /// Heading.
    pub title: String,
    /// What is predicted, such as the name of a label column.
    pub target: String,
    /// Data, classifier, protocol, versions, command.
    pub facts: Vec<Fact>,
    /// Names of the classes, in the order of every matrix below.
    pub classes: Vec<String>,
    /// The recordings that were looked at.
    pub recordings: Vec<Recording>,
    /// A recording of each class, with the class's number.
    pub examples: Vec<(usize, RecordingPicture)>,
    /// Scores of all rows, in percent.
    pub scores: Vec<Score>,
    /// What the rows that are scored are, as a sentence: held out from training, or not known.
    pub protocol: String,
    /// How the intervals of the scores were made, as a sentence.
    pub intervals: String,
    /// The same for each fold: its name and the scores in the order of `scores`.
    pub folds: Vec<(String, Vec<f64>)>,
    /// The same for the whole with other seeds: the seed and its scores.
    pub seeds: Vec<(u32, Vec<f64>)>,
    /// Measures of the probabilities: name, value, meaning.
    pub measures: Vec<(String, f64, String)>,
    /// Scores of each class.
    pub class_scores: Vec<ClassScore>,
    /// `[true class, estimated class]`; a last column counts rows without an estimate.
    pub confusion: Array2<u64>,
    /// How often predictions of a confidence are right.
    pub calibration: Vec<CalibrationBin>,
    /// Curves of classes against all others.
    pub curves: Vec<ClassCurve>,
    /// What each family of features contributes.
    pub importances: Vec<Importance>,
    /// Scores by the number of training rows.
    pub learning: Vec<LearningPoint>,
    /// The predictions.
    pub predictions: Vec<Prediction>,
}

/// What is known of a recording before anything is learned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Its id.
    pub id: String,
    /// Number of its class, where it is known.
    pub class: Option<usize>,
    /// Length in seconds.
    pub seconds: f64,
    /// Frames per second.
    pub sample_rate: u32,
    /// Channels.
    pub channels: u16,
    /// Largest magnitude in dB relative to full scale; `None` for silence.
    pub peak_dbfs: Option<f64>,
    /// What is odd about its channels.
    pub notes: Vec<String>,
    /// Why it could not be read.
    pub failure: Option<String>,
}

/// A score with the interval that it lies in, in percent.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Name, such as "weighted F1".
    pub name: String,
    /// Value.
    pub value: f64,
    /// Lower and upper end.
    pub interval: Option<(f64, f64)>,
}

/// Scores of a class in percent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassScore {
    /// Share of the estimates of this class that are right.
    pub precision: f64,
    /// Share of its rows that are found.
    pub recall: f64,
    /// Harmonic mean of both.
    pub f1: f64,
    /// Its rows.
    pub support: usize,
}

/// Predictions of similar confidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationBin {
    /// Their mean probability of the class that they name, 0 to 1.
    pub confidence: f64,
    /// Share of them that are right, 0 to 1.
    pub accuracy: f64,
    /// How many there are.
    pub count: usize,
}

/// How one class is told from all others as the threshold of its probability falls.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassCurve {
    /// Number of the class.
    pub class: usize,
    /// False positive rate and true positive rate, 0 to 1.
    pub roc: Vec<(f64, f64)>,
    /// Area under it.
    pub roc_auc: f64,
    /// Recall and precision, 0 to 1.
    pub precision_recall: Vec<(f64, f64)>,
    /// Average precision.
    pub average_precision: f64,
}

/// What permuting a family of features among the held-out rows costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Importance {
    /// Name of the family, such as "mfcc".
    pub family: String,
    /// Features in it.
    pub features: usize,
    /// Mean loss of accuracy over folds and repetitions, in percentage points.
    pub loss: f64,
    /// Smallest and largest loss.
    pub range: (f64, f64),
}

/// Score of models trained on a part of the training rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningPoint {
    /// Mean number of training rows.
    pub rows: f64,
    /// Mean accuracy over folds, in percent.
    pub accuracy: f64,
    /// Lowest and highest accuracy among the folds.
    pub range: (f64, f64),
}

/// The prediction of a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prediction {
    /// Its id.
    pub id: String,
    /// Number of its true class.
    pub truth: usize,
    /// Number of the class predicted; `None` where there is no answer.
    pub predicted: Option<usize>,
    /// Probability of the class predicted, where it is known.
    pub confidence: Option<f64>,
    /// Where to listen: the stretch of the recording in seconds, where the row is a part of it.
    pub stretch: Option<(f64, f64)>,
}

impl Study {
    /// Name of a class.
    pub(super) fn class_name(&self, class: usize) -> &str {
        self.classes.get(class).map_or("?", String::as_str)
    }
}
