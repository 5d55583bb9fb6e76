//! Why a labelled table cannot be used.

use std::path::{Path, PathBuf};

use corsmal_files::feature_file::FeatureFileError;
use corsmal_files::npz::NpzError;
use thiserror::Error;

use crate::error::ModelError;

/// Why a labelled table cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// An archive cannot be read.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The feature file cannot be read.
    #[error(transparent)]
    Features(#[from] FeatureFileError),
    /// A file holds something else than it should.
    #[error("{path}: {reason}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, what was expected, what to do.
        reason: String,
    },
    /// Labels or folds that cannot be learned from.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl DatasetError {
    pub(crate) fn content(path: &Path, reason: impl Into<String>) -> Self {
        Self::Content { path: path.into(), reason: reason.into() }
    }
}

/// Result with this module's error.
pub type Result<T> = std::result::Result<T, DatasetError>;
