//! What can go wrong with a Parquet file.

use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use crate::table::TableError;

/// What can go wrong with a Parquet file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ParquetTableError {
    /// The operating system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// The Parquet layer refused.
    #[error("{path}: {source}")]
    Parquet {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: ParquetError,
    },
    /// Not a table of this tool.
    #[error("{path}: expected {expected}, found {actual}")]
    Layout {
        /// The file.
        path: PathBuf,
        /// What was expected.
        expected: String,
        /// What is there.
        actual: String,
    },
    /// Columns and metadata contradict each other.
    #[error("{path}: {source}")]
    Table {
        /// The file.
        path: PathBuf,
        /// How.
        source: TableError,
    },
}

pub(super) fn io(path: &Path, source: std::io::Error) -> ParquetTableError {
    ParquetTableError::Io { path: path.into(), source }
}

pub(super) fn layer(path: &Path, source: ParquetError) -> ParquetTableError {
    ParquetTableError::Parquet { path: path.into(), source }
}

pub(super) fn layout(
    path: &Path,
    expected: impl std::fmt::Display,
    actual: impl std::fmt::Display,
) -> ParquetTableError {
    ParquetTableError::Layout {
        path: path.into(),
        expected: expected.to_string(),
        actual: actual.to_string(),
    }
}
