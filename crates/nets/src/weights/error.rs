//! Why weights could not be read or written.

use std::path::PathBuf;

use thiserror::Error;

/// Why weights could not be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// the file
        path: PathBuf,
        /// why
        source: std::io::Error,
    },
    /// The name of a file to write says no format.
    #[error("{}: must end in .npz or .safetensors", path.display())]
    Ending {
        /// the file
        path: PathBuf,
    },
    /// The content is damaged, or no weights.
    #[error("{}: {reason}", path.display())]
    Content {
        /// the file
        path: PathBuf,
        /// why
        reason: String,
    },
}
