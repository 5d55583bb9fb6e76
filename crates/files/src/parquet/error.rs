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
    /// A file of ours does not match its hashes.
    #[error("{path}: the file is damaged: {reason}; restore it from a copy or make it again")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not match.
        reason: String,
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

/// What does not match, among the errors of the Parquet layer.
#[derive(Debug, Error)]
#[error("{0}")]
pub(super) struct Damage(pub String);

pub(super) fn layer(path: &Path, source: ParquetError) -> ParquetTableError {
    let path = path.into();
    match damage(&source) {
        Some(Damage(reason)) => ParquetTableError::Damaged { path, reason: reason.clone() },
        None => ParquetTableError::Parquet { path, source },
    }
}

fn damage(source: &ParquetError) -> Option<&Damage> {
    let ParquetError::External(inner) = source else { return None };
    let read = inner.downcast_ref::<std::io::Error>().and_then(|e| e.get_ref());
    inner.downcast_ref().or_else(|| read?.downcast_ref())
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
