//! Prediction files: one line per recording or window, with the class predicted and `p_<label>` for
//! each class. All are written and read here: those of `classify`, `cross-validate` and `fuse`, and
//! those that others published with columns `p0`, `p1`, ….
//!
//! ```
//! use corsmal_models::predictions::PredictionTable;
//!
//! let text = "id,true,predicted,p_rice,p_water\na,rice,rice,0.9,0.1\nb,water,rice,0.6,0.4\n";
//! let table = PredictionTable::parse(text.as_bytes(), "held-out.csv".as_ref())?;
//! assert_eq!(table.labels, ["rice", "water"]);
//! assert_eq!(table.rows[1].class, Some(0));
//! assert_eq!(table.column("true").unwrap(), ["rice", "water"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod align;
mod labels;
mod read;
mod record;
mod write;

use std::fmt::{self, Display};
use std::hash::Hash;
use std::path::{Path, PathBuf};

use ndarray::{Array2, ArrayView2};
use thiserror::Error;

use crate::error::ModelError;
use crate::fusion;

pub use labels::NO_TARGETS;
pub use record::{Record, RecordWriter, Unit};
pub use write::{Cell, Form, PredictionWriter};

/// How far the sum of a line's probabilities may be from one.
pub const SUM_TOLERANCE: f64 = 1e-3;

/// Largest prediction file that is read.
const MAX_BYTES: u64 = 2 << 30;

/// What a prediction is called that was rejected.
pub const UNKNOWN: &str = "unknown";
/// Columns that name a recording, the first of them that a file has.
const KEYS: [&str; 3] = ["id", "Configuration ID", "path"];

/// Columns of windows and of how a line came about: a decision over several lines has none of its own.
const OF_LINES: [&str; 3] = ["start", "end", "windows"];
/// What became of the recording: a decision over several lines has the worst of theirs.
const STATUS: &str = "status";
/// Column of the folds that held lines out.
const FOLD: &str = "fold";
/// Columns of a recording that every file and every window must give alike, where they have them.
const AGREED: [&str; 3] = ["true", FOLD, "group"];

/// What can be wrong with prediction files.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PredictionError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not a table, or has no predictions.
    #[error("{path}: {reason}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what was expected.
        reason: String,
    },
    /// A column is missing.
    #[error("{path}: no column {column}; the header has: {header}")]
    Column {
        /// The file.
        path: PathBuf,
        /// What is needed.
        column: String,
        /// The columns that are there.
        header: String,
    },
    /// A cell holds a value that is not allowed.
    #[error("{path}, line {line}, column '{column}': '{value}' is not {expected}")]
    Value {
        /// The file.
        path: PathBuf,
        /// Line in the file, the header being line 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// The text of the cell.
        value: String,
        /// What is allowed.
        expected: String,
    },
    /// Files that are to be joined do not have the same recordings.
    #[error("{path}: {problem}: {row}; expected exactly one line for each of {expected}")]
    Rows {
        /// The file.
        path: PathBuf,
        /// "missing rows", "more than one row", …
        problem: &'static str,
        /// The first row concerned.
        row: String,
        /// What the other file has.
        expected: String,
    },
    /// Predictions that cannot be joined or scored.
    #[error("{path}: {source}")]
    Model {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ModelError,
    },
}

/// Result with this module's error.
pub type Result<T> = std::result::Result<T, PredictionError>;

/// What names a recording in messages and tells it from others: its id.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Id(pub String);

impl Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "id {}", self.0)
    }
}

/// A line of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionRow<K = Id> {
    /// The recording.
    pub key: K,
    /// Text of the table's columns.
    pub cells: Vec<String>,
    /// The class predicted, or else the most probable one; `None` without a prediction.
    pub class: Option<usize>,
    /// One per class; `None` where the classifier gave none.
    pub proba: Option<Vec<f64>>,
}

/// Predictions of recordings, or of their windows. `K` tells recordings apart.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionTable<K = Id> {
    /// Where they were read from.
    pub path: PathBuf,
    /// Columns beside prediction and probabilities, those that name the recording first.
    pub columns: Vec<String>,
    /// How many of the columns name the recording.
    pub naming: usize,
    /// Name of each class.
    pub labels: Vec<String>,
    /// The lines, in the order of the file.
    pub rows: Vec<PredictionRow<K>>,
    /// Labels of a label file that no line of the table has, if there are such.
    pub unmatched: Option<String>,
}

impl<K> PredictionTable<K> {
    /// Text of a column, one value per line.
    pub fn column(&self, name: &str) -> Option<Vec<&str>> {
        let at = self.columns.iter().position(|column| column == name)?;
        Some(self.rows.iter().map(|row| row.cells[at].as_str()).collect())
    }

    /// The folds that held the lines out. Beside `status`, which `classify` writes, `fold` is a label of the
    /// recordings.
    pub fn held_out_folds(&self) -> Option<Vec<&str>> {
        self.column(FOLD).filter(|_| self.column(STATUS).is_none())
    }

    /// What a table has in place of folds, in words.
    pub fn no_folds(&self) -> &'static str {
        match self.column(FOLD) {
            None => "none",
            Some(_) => "none (beside status, its column fold is a label)",
        }
    }

    /// Whether a recording has one value of this column in all its lines and in all files.
    pub(crate) fn is_agreed(&self, column: &str) -> bool {
        AGREED.contains(&column) && (column != FOLD || self.held_out_folds().is_some())
    }

    /// The true class of each line as text: of the column named, or of one called `true`.
    ///
    /// # Errors
    /// [`PredictionError::Column`]; an empty cell.
    pub fn truth(&self, column: Option<&str>) -> Result<Vec<&str>> {
        let name = column.unwrap_or("true");
        let Some(values) = self.column(name) else {
            let header = self.columns.iter().map(String::as_str);
            let choices = corsmal_names::choices(name, header);
            let remedy = "--labels adds true classes from a CSV, --target names their column";
            return Err(
                self.content(format!("no column {name:?} with true classes; {choices}. {remedy}"))
            );
        };
        match values.iter().position(|value| value.is_empty()) {
            None => Ok(values),
            Some(at) => {
                let (row, empty) =
                    (&self.rows[at].cells[0], values.iter().filter(|v| v.is_empty()));
                let lines = crate::words::count(empty.count(), "such line");
                Err(self.content(format!("{row}: has no true class ({name} is empty; {lines})")))
            }
        }
    }

    /// The same lines told apart by other keys.
    pub fn with_keys<L>(self, key: impl Fn(&PredictionRow<K>) -> L) -> PredictionTable<L> {
        let Self { path, columns, naming, labels, rows, unmatched } = self;
        let rows = rows.into_iter().map(|row| {
            let key = key(&row);
            PredictionRow { key, cells: row.cells, class: row.class, proba: row.proba }
        });
        PredictionTable { path, columns, naming, labels, rows: rows.collect(), unmatched }
    }

    /// Probabilities `[lines, classes of into]`: each class of the table is one of `n_classes`
    /// others. Zero where there are none.
    ///
    /// # Errors
    /// Classes outside `n_classes`.
    pub fn merged(&self, into: &[usize], n_classes: usize) -> Result<Array2<f64>> {
        let mut all = Vec::with_capacity(self.rows.len() * self.labels.len());
        for row in &self.rows {
            match &row.proba {
                Some(proba) => all.extend_from_slice(proba),
                None => all.extend(std::iter::repeat_n(0.0, self.labels.len())),
            }
        }
        let all = ArrayView2::from_shape((self.rows.len(), self.labels.len()), &all)
            .map_err(|e| self.model(ModelError::Inconsistent(e.to_string())))?;
        fusion::merge_classes(all, into, n_classes).map_err(|e| self.model(e))
    }

    /// Lines without a prediction.
    pub fn without_prediction(&self) -> usize {
        self.rows.iter().filter(|row| row.class.is_none()).count()
    }

    pub(crate) fn model(&self, source: ModelError) -> PredictionError {
        PredictionError::Model { path: self.path.clone(), source }
    }

    pub(crate) fn content(&self, reason: impl Into<String>) -> PredictionError {
        content(&self.path, reason)
    }
}

impl<K: Clone + Eq + Hash + Ord + Display> PredictionTable<K> {
    /// Takes away predictions whose highest probability is below `least`: their class is unknown.
    ///
    /// # Errors
    /// [`PredictionError::Content`] where a prediction has no probabilities.
    pub fn reject_below(&mut self, least: f64) -> Result<()> {
        if self.labels.iter().any(|label| label == UNKNOWN) {
            let reason = format!("rejected predictions are called {UNKNOWN:?}, as a class is");
            return Err(self.content(reason));
        }
        let uncertain = |row: &PredictionRow<K>| row.class.is_some() && row.proba.is_none();
        if let Some(row) = self.rows.iter().find(|row| uncertain(row)) {
            let reason = format!("{}: has no probabilities to reject predictions by", row.key);
            return Err(self.content(reason));
        }
        for row in &mut self.rows {
            let highest = row.proba.iter().flatten().copied().fold(0.0, f64::max);
            row.class = row.class.filter(|_| highest >= least);
        }
        Ok(())
    }
}

pub(crate) fn content(path: &Path, reason: impl Into<String>) -> PredictionError {
    PredictionError::Content { path: path.into(), reason: reason.into() }
}
