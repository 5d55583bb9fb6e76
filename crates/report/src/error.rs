//! What can go wrong when a report is written.

use std::path::PathBuf;

/// Why a report was not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A folder could not be made.
    #[error("cannot make the folder {}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file of an earlier report could not be removed.
    #[error("cannot remove {}, which an earlier report wrote: {source}", path.display())]
    Remove {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file could not be written; the text names it.
    #[error(transparent)]
    Write(std::io::Error),
    /// A table could not be written as CSV.
    #[error("table {name}: {reason}")]
    Table {
        /// Its name.
        name: String,
        /// What was wrong.
        reason: String,
    },
    /// The report could not be written as JSON.
    #[error("report as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A recording could not be read.
    #[error("{}: {source}", path.display())]
    Audio {
        /// The recording.
        path: PathBuf,
        /// Why.
        source: corsmal_audio::AudioError,
    },
    /// The spectrum of a recording could not be drawn.
    #[error("{}: {source}", path.display())]
    Spectrum {
        /// The recording.
        path: PathBuf,
        /// Why.
        source: corsmal_dsp::error::DspError,
    },
    /// A figure could not be drawn.
    #[error("figure {name}: {source}")]
    Figure {
        /// Its name.
        name: String,
        /// What was wrong.
        source: corsmal_plot::PlotError,
    },
}

/// Result with this crate's error.
pub type Result<T> = std::result::Result<T, ReportError>;
