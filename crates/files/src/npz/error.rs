//! What can go wrong with an archive.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::npy::NpyError;

/// What can go wrong with an archive.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NpzError {
    /// The operating system refused.
    #[error("{path}: {source}")]
    Io {
        /// The archive.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// The file is not a readable zip archive.
    #[error("{path}: not a readable npz archive: {reason}")]
    Archive {
        /// The archive.
        path: PathBuf,
        /// What the zip layer says.
        reason: String,
    },
    /// There is no such member.
    #[error("{path}: no member {member:?}")]
    Missing {
        /// The archive.
        path: PathBuf,
        /// The member's name without `.npy`.
        member: String,
    },
    /// A member contradicts the `.npy` format.
    #[error("{path}: member {member:?}: {source}")]
    Npy {
        /// The archive.
        path: PathBuf,
        /// The member's name without `.npy`.
        member: String,
        /// What is wrong.
        source: NpyError,
    },
    /// A member is sound but not what was asked for, or not what it promises.
    #[error("{path}: member {member:?}: expected {expected}, found {actual}")]
    Member {
        /// The archive.
        path: PathBuf,
        /// The member's name without `.npy`.
        member: String,
        /// What was expected.
        expected: String,
        /// What is there.
        actual: String,
    },
}

impl NpzError {
    /// What the operating system said of `path`.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), source }
    }

    pub(super) fn npy(path: &Path, member: &str, source: NpyError) -> Self {
        Self::Npy { path: path.to_path_buf(), member: member.to_string(), source }
    }

    pub(crate) fn member(
        path: &Path,
        member: &str,
        expected: impl std::fmt::Display,
        actual: impl std::fmt::Display,
    ) -> Self {
        Self::Member {
            path: path.to_path_buf(),
            member: member.to_string(),
            expected: expected.to_string(),
            actual: actual.to_string(),
        }
    }
}
