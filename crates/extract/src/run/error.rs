//! Why a run ends without its output.

use std::path::PathBuf;

use corsmal_files::format::FormatError;
use corsmal_files::npz::NpzError;
use corsmal_files::parquet::ParquetTableError;
use corsmal_files::table::TableError;
use thiserror::Error;

use crate::ledger::LedgerError;

/// Why a run could not start or go on. Bad recordings are not among these: they are outcomes.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RunError {
    /// The output is there and holds something else.
    #[error("{path} exists and {why}; --overwrite replaces it")]
    Exists {
        /// The output.
        path: PathBuf,
        /// What it is.
        why: String,
    },
    /// The output is there, holds something else, and an interrupted run was to replace it.
    #[error(
        "{path} exists and {why}; an interrupted run was to replace it: --overwrite with --resume continues that run, \
         --overwrite starts again"
    )]
    Replaced {
        /// The output.
        path: PathBuf,
        /// What it is.
        why: String,
    },
    /// An interrupted run is there.
    #[error(
        "{path} was left by an interrupted run; --resume continues it, --overwrite starts again"
    )]
    Pending {
        /// Its ledger.
        path: PathBuf,
    },
    /// Frames have no place in a table.
    #[error(
        "a .parquet table holds statistics: add a [summary] to the configuration, or write .npz"
    )]
    NoSummary,
    /// An input of the interrupted run cannot be read now.
    #[error(
        "{path} cannot be read now, but the interrupted run may have read it: make it readable and run the same \
         command again"
    )]
    Unreadable {
        /// The input.
        path: String,
    },
    /// The output cannot take what the configuration gives.
    #[error("{path}: {why}")]
    Format {
        /// The output.
        path: PathBuf,
        /// Why, and what is allowed.
        why: String,
    },
    /// No file can be made in the folder of the output; says which and why.
    #[error(transparent)]
    Folder(std::io::Error),
    /// The output cannot be partitioned so.
    #[error("cannot partition by {label:?}: {why}")]
    Partition {
        /// The label.
        label: String,
        /// Why, and what is allowed.
        why: String,
    },
    /// A work folder without anything in a store.
    #[error(
        "{path} is not in a store: the work folder {work} is only for outputs and shards in stores"
    )]
    Work {
        /// The output.
        path: PathBuf,
        /// The folder.
        work: PathBuf,
    },
    /// An output in a store cannot be looked at, or have its name.
    #[error("{name}: {reason}")]
    Store {
        /// Its URI.
        name: String,
        /// What is wrong with it, or with the store.
        reason: String,
    },
    /// The finished output did not reach its store.
    #[error(
        "{name}: {reason}; the finished output is in {file}: run the same command again to send it"
    )]
    Unsent {
        /// Its URI.
        name: String,
        /// The file.
        file: PathBuf,
        /// What the store said.
        reason: String,
    },
    /// More failures than allowed.
    #[error("stopped after {failed} failed files ({limit} allowed), the last: {last}")]
    TooManyErrors {
        /// Failed files.
        failed: usize,
        /// Allowed.
        limit: usize,
        /// Path and reason of the last.
        last: String,
    },
    /// The user stopped the run; `--resume` continues it.
    #[error("interrupted; --resume continues the run")]
    Interrupted,
    /// The output failed.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The ledger failed.
    #[error(transparent)]
    Ledger(#[from] LedgerError),
    /// The table failed.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The Parquet output failed.
    #[error(transparent)]
    Parquet(#[from] ParquetTableError),
    /// The output has a name that none can have.
    #[error(transparent)]
    Name(#[from] FormatError),
    /// A fault of this program while writing the output.
    #[error(
        "this is a bug in corsmal-feat: please report it; the same command with --resume continues the run"
    )]
    Broken,
    /// A temporary file beside the output failed.
    #[error("{path}: temporary file: {source}")]
    Temporary {
        /// Its folder.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The pool of threads could not be started.
    #[error("cannot run {jobs} jobs: {why}")]
    Jobs {
        /// Number asked for.
        jobs: usize,
        /// What is allowed, or what the system says.
        why: String,
    },
}
