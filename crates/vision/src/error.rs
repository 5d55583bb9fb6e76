//! What can be wrong with images, calibrations, masks and tables of detections.

use std::path::{Path, PathBuf};

/// Result with this crate's error.
pub type Result<T> = std::result::Result<T, VisionError>;

/// Errors name the file, the place, what was found and what is expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VisionError {
    /// A file could not be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is not what it should be.
    #[error("{path}: {reason}")]
    File {
        /// The file.
        path: PathBuf,
        /// The place in it, what was found and what is expected.
        reason: String,
    },
    /// A limit on what is read from outside.
    #[error("{path}: {what} is {actual}; the limit is {limit}")]
    Limit {
        /// The file.
        path: PathBuf,
        /// What is too large.
        what: &'static str,
        /// Its size.
        actual: u64,
        /// The largest size that is read.
        limit: u64,
    },
    /// A detection's mask is not what it should be.
    #[error("mask of '{label}' in frame {frame}, view {view}: {reason}")]
    Mask {
        /// Number of the frame.
        frame: u32,
        /// View, 1 to 4.
        view: u8,
        /// What was detected.
        label: String,
        /// What was found and what is expected.
        reason: String,
    },
    /// Inputs that contradict each other, or that nothing could be seen with.
    #[error("{0}")]
    Conflict(String),
    /// Nothing that could be measured, or arguments that nothing can be made of.
    #[error("{0}")]
    Request(String),
}

impl VisionError {
    /// An input error at `path`.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }

    /// What is wrong, without the path of the file, for a message that names it otherwise.
    pub fn reason(&self) -> String {
        match self {
            Self::Io { source, .. } => source.to_string(),
            Self::File { reason, .. } => reason.clone(),
            Self::Limit { what, actual, limit, .. } => {
                format!("{what} is {actual}; the limit is {limit}")
            }
            Self::Mask { .. } | Self::Conflict(_) | Self::Request(_) => self.to_string(),
        }
    }

    /// A fault in the content of the file at `path`.
    pub fn file(path: &Path, reason: impl Into<String>) -> Self {
        Self::File { path: path.into(), reason: reason.into() }
    }
}

/// Reads a whole file of at most `limit` bytes.
pub(crate) fn read(path: &Path, limit: u64) -> Result<Vec<u8>> {
    corsmal_files::content::read(path, limit).map_err(|e| VisionError::io(path, e))
}
