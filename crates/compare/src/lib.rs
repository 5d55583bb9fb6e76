//! Differences between two feature files, and what probably caused them.
//!
//! One pair of arrays is held at a time. An array is seen as `[channel, coefficient, frame]`: its
//! last axis as frames, the one before as coefficients, all before that as channels; a table of
//! summaries as `[1, column, row]`.
//!
//! ```
//! use corsmal_compare::{Criteria, compare};
//! use corsmal_files::npz::{Compression, NpzWriter};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let (a, b) = (folder.path().join("a.npz"), folder.path().join("b.npz"));
//! for (path, scale) in [(&a, 1.0), (&b, 2.0)] {
//!     let values: Vec<f32> = (1..=60).map(|i| scale * (i as f32).sqrt()).collect();
//!     let mut writer = NpzWriter::create(path, Compression::Stored)?;
//!     writer.floats("mfcc", &[3, 20], &values)?;
//!     writer.finish()?;
//! }
//! let found = compare(&a, &b, &Criteria::default())?;
//! assert!(!found.within);
//! assert_eq!(found.features[0].differing, 1);
//! assert!(!found.features[0].causes.is_empty(), "a factor of two");
//! # Ok(())
//! # }
//! ```

mod causes;
mod compared_file;
mod comparison;
mod difference;
mod matching;
mod pair;
mod settings;

use std::path::{Path, PathBuf};

use thiserror::Error;

use corsmal_files::feature_file::FeatureFileError;
use corsmal_files::layout::LayoutError;
use corsmal_files::npz::NpzError;
use corsmal_files::parquet::ParquetTableError;

pub use causes::{Cause, CauseKind};
pub use comparison::{Comparison, FeatureReport, FileReport, Finding, Refused, Shapes};
pub use difference::{Difference, Extreme, Tolerance};
pub use settings::{Setting, Settings};

use compared_file::ComparedFile;
use comparison::Collector;
use matching::Matching;

/// Why two files could not be compared.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FeatureFileError),
    /// A member cannot be read.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// An output of ours contradicts itself.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// A Parquet table cannot be read.
    #[error(transparent)]
    Parquet(#[from] ParquetTableError),
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
    /// Nothing to compare.
    #[error(
        "no numeric arrays in common: {a} has {in_a}; {b} has {in_b} (pairs can be named: a=b)"
    )]
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

/// What counts as equal, and which arrays belong together.
#[derive(Debug, Clone, Default)]
pub struct Criteria {
    /// What counts as equal.
    pub tolerance: Tolerance,
    /// Arrays of the first file and their counterparts in the second, where names differ.
    pub map: Vec<(String, String)>,
}

/// Compares two files: `.npz`, `.npy` or Parquet, ours or not.
///
/// # Errors
/// [`CompareError`]: a file cannot be read, or they have nothing in common.
pub fn compare(a: &Path, b: &Path, criteria: &Criteria) -> Result<Comparison, CompareError> {
    let (mut a, mut b) = (ComparedFile::open(a)?, ComparedFile::open(b)?);
    let matching = Matching::new(&a, &b, &criteria.map)?;
    let mut collector = Collector::new(criteria.tolerance);
    for found in &matching.arrays {
        let values = (a.load(found.a)?, b.load(found.b)?);
        collector.arrays(found, &a.arrays()[found.a], &b.arrays()[found.b], values);
    }
    for found in &matching.tables {
        collector.table(found, a.table(), b.table());
    }
    Ok(collector.finish(&a, &b, matching))
}
