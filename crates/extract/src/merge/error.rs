//! Why shards are not merged.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::feature_file::FeatureFileError;
use corsmal_files::format::FormatError;
use corsmal_files::npz::NpzError;
use corsmal_files::parquet::ParquetTableError;
use corsmal_files::table::TableError;
use thiserror::Error;

use crate::ledger::LedgerError;
use crate::run::RunError;

/// What can go wrong with merging.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MergeError {
    /// An output or a shard in a store, with what is wrong with it; or the user stopped the merge.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A shard cannot be read.
    #[error(transparent)]
    Shard(#[from] FeatureFileError),
    /// A member of a shard cannot be read, or the result not be written.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The Parquet result cannot be written.
    #[error(transparent)]
    Parquet(#[from] ParquetTableError),
    /// The result cannot be put in its place.
    #[error(transparent)]
    Ledger(#[from] LedgerError),
    /// The result is there already, or an interrupted run that was to write it.
    #[error("{path} exists; --overwrite replaces it, --resume continues an interrupted merge")]
    Exists {
        /// The output or its ledger.
        path: PathBuf,
    },
    /// A merge is to be continued, but its result is there.
    #[error("{path} is whole: no interrupted merge is left to continue; --overwrite merges again")]
    Whole {
        /// The output.
        path: PathBuf,
    },
    /// Something that no file can replace is where the result is to be.
    #[error("{path} exists and is not a regular file")]
    NoFile {
        /// What is there.
        path: PathBuf,
    },
    /// The result would take the place of a shard.
    #[error("{path} is one of the shards: give the merged output another name")]
    IsShard {
        /// The output.
        path: PathBuf,
    },
    /// The result must have another name.
    #[error(transparent)]
    Name(#[from] FormatError),
    /// The files are not the shards of one run.
    #[error("{path}: expected {expected}, found {actual}")]
    NotOneRun {
        /// The file that does not fit.
        path: PathBuf,
        /// What would fit.
        expected: String,
        /// What it is.
        actual: String,
    },
    /// A shard is no longer the file that was found first.
    #[error("{path} was changed while it was merged; merge again once nothing writes to it")]
    Changed {
        /// The shard.
        path: PathBuf,
    },
    /// A shard that was copied from a store, by its name there, and what is wrong with it.
    #[error("{0}")]
    Copied(String),
    /// The tables of two shards do not fit together.
    #[error("{path}: {source}")]
    Table {
        /// The file that does not fit the ones before.
        path: PathBuf,
        /// Why.
        source: TableError,
    },
}

/// Ends the merge where the user has stopped it.
pub(super) fn go_on(stop: &AtomicBool) -> Result<(), MergeError> {
    match stop.load(Ordering::Relaxed) {
        true => Err(RunError::Interrupted.into()),
        false => Ok(()),
    }
}
