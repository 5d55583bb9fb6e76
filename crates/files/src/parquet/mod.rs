//! The summary table as a Parquet file: column `id`, the label columns (text), one 32-bit float
//! column per feature. Configuration, provenance and outcomes are in the file's key-value metadata.

mod limits;
mod numeric;
mod reader;
mod thrift;
mod writer;

use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use thiserror::Error;

use crate::table::TableError;

pub use limits::{MAX_PAGE, MAX_TEXT, MAX_VALUES, MAX_VALUES_A_BYTE};
pub use numeric::NumericTable;
pub use reader::ParquetFile;
pub use writer::{write, write_over};

const META: &str = "corsmal.meta";
const CONFIG: &str = "corsmal.config";
const OUTCOMES: &str = "corsmal.outcomes";

/// Rows written together, and read at a time.
const ROWS: usize = 1 << 16;

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

fn io(path: &Path, source: std::io::Error) -> ParquetTableError {
    ParquetTableError::Io { path: path.into(), source }
}

fn layer(path: &Path, source: ParquetError) -> ParquetTableError {
    ParquetTableError::Parquet { path: path.into(), source }
}

fn layout(
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
