//! What can be wrong with the files of the benchmark.

use std::path::{Path, PathBuf};

/// Result with this crate's error.
pub type Result<T> = std::result::Result<T, CcmError>;

/// Errors name the file (and line where there is one), what was found and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CcmError {
    /// A file or folder could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file could not be written; the text names it.
    #[error(transparent)]
    Write(std::io::Error),
    /// The file is not a table of comma-separated values.
    #[error("{path}: not a readable table: {reason}")]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the line where it is known.
        reason: String,
    },
    /// A table lacks a column.
    #[error("{path}: no column '{column}'; the header has: {header}")]
    Column {
        /// The file.
        path: PathBuf,
        /// The column that is needed.
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
        line: usize,
        /// Name of the column.
        column: String,
        /// The text of the cell.
        value: String,
        /// What is allowed.
        expected: &'static str,
    },
    /// The rows of a table are not those of the annotations.
    #[error("{path}: {problem}: {rows}; expected exactly one row for each of {expected}")]
    Rows {
        /// The file.
        path: PathBuf,
        /// "missing rows", "rows that the annotations lack", "more than one row".
        problem: &'static str,
        /// The first rows concerned and how many there are.
        rows: String,
        /// What the annotations have.
        expected: String,
    },
    /// Prediction files that cannot be read or joined; the text names the file.
    #[error(transparent)]
    Predictions(#[from] corsmal_models::predictions::PredictionError),
    /// The report could not be made; the text says why.
    #[error(transparent)]
    Report(#[from] corsmal_report::ReportError),
    /// The user stopped the work; what is done is kept for the next run.
    #[error("interrupted; run the same command again to continue")]
    Interrupted,
    /// A request that cannot be met; the text says why and what is possible.
    #[error("{0}")]
    Request(String),
}

impl CcmError {
    /// An input or output error at `path`.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), source }
    }
}
