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
    /// The file's ending is none of those known.
    #[error("{}: weights end in .npz, .safetensors, .pth or .pt", path.display())]
    Ending {
        /// the file
        path: PathBuf,
    },
    /// The content is not what the ending says, or holds something else than weights.
    #[error("{}: {reason}", path.display())]
    Content {
        /// the file
        path: PathBuf,
        /// why
        reason: String,
    },
}
