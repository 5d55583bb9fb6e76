//! Why a picture could not be made.

use thiserror::Error;

/// Why a picture could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The picture would have more pixels than is sensible.
    #[error(
        "a picture of {width} x {height} pixels is too large (at most {limit} in all); ask for a \
         lower resolution, fewer channels or SVG"
    )]
    TooLarge {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Largest product of both.
        limit: usize,
    },
    /// The PNG encoder failed.
    #[error("cannot encode PNG: {0}")]
    Png(#[from] png::EncodingError),
    /// The SVG of a figure could not be read back.
    #[error("cannot read the drawing: {0}")]
    Svg(String),
    /// The PDF writer failed.
    #[error("cannot write PDF: {0}")]
    Pdf(String),
}
