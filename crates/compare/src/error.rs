//! Why files are not compared.

use std::path::PathBuf;

use corsmal_files::feature_file::FeatureFileError;
use thiserror::Error;

/// Why two files could not be compared.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FeatureFileError),
    /// A name of `--map` that is not in its file.
    #[error("{path}: no array {name:?} to map; there are {known}")]
    Unmapped {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
        /// The arrays of the file.
        known: String,
    },
    /// Two outputs of ours over other recordings.
    #[error(
        "no recording in common, by id, file name or content: {a} has {in_a}; {b} has {in_b}. Name pairs of \
         arrays with --map, or extract the same recordings"
    )]
    NoRecordingInCommon {
        /// First file.
        a: PathBuf,
        /// Second file.
        b: PathBuf,
        /// Recordings of the first.
        in_a: String,
        /// Recordings of the second.
        in_b: String,
    },
    /// An id that names several rows, which are paired by it.
    #[error(
        "{path}: the id {id:?} names several rows, but rows are paired by their ids: make them \
         different, or leave the column out"
    )]
    RepeatedId {
        /// The file.
        path: PathBuf,
        /// The id.
        id: String,
    },
    /// Two outputs of ours over the same recordings, of other features or kinds.
    #[error(
        "recordings are the same, but nothing of them is in both files: {a} has {in_a}; {b} has \
         {in_b}. Compare frames with frames, or statistics with statistics, of the same features"
    )]
    NoFeatureInCommon {
        /// First file.
        a: PathBuf,
        /// Second file.
        b: PathBuf,
        /// Arrays of the first.
        in_a: String,
        /// Arrays of the second.
        in_b: String,
    },
    /// Nothing to compare.
    #[error("no numeric arrays in common: {a} has {in_a}; {b} has {in_b} (--map A=B names a pair)")]
    NothingInCommon {
        /// First file.
        a: PathBuf,
        /// Second file.
        b: PathBuf,
        /// Arrays of the first.
        in_a: String,
        /// Arrays of the second.
        in_b: String,
    },
}
