//! Why a recording cannot be read.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// A refusal of one recording. Offsets count bytes from the start of the file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum AudioError {
    /// The file could not be opened.
    #[error("cannot open {}: {source}", path.display())]
    Open {
        /// The path as given.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Reading or seeking failed.
    #[error("reading failed at byte {offset}: {source}")]
    Io {
        /// Where the reader was.
        offset: u64,
        /// What the system said.
        source: io::Error,
    },
    /// There is not a single byte.
    #[error("the file is empty (0 bytes)")]
    Empty,
    /// The first bytes belong to no format that this crate reads.
    #[error("not a known audio format: starts with {found}, expected {expected}")]
    NotAudio {
        /// The first bytes, escaped.
        found: String,
        /// Formats that are read.
        expected: &'static str,
    },
    /// Well-formed, but of a kind that is not read.
    #[error("unsupported at byte {offset}: {actual}; supported: {expected}")]
    Unsupported {
        /// Where the file says so.
        offset: u64,
        /// What the file holds.
        actual: String,
        /// What would be read.
        expected: &'static str,
    },
    /// The bytes contradict their format.
    #[error("corrupt at byte {offset}: {actual}; expected {expected}")]
    Corrupt {
        /// Where the contradiction is.
        offset: u64,
        /// What is there.
        actual: String,
        /// What should be there.
        expected: &'static str,
    },
    /// `seek` on a source that only reads forward.
    #[error("this source cannot seek (a stream or a compressed format)")]
    NotSeekable,
}

/// What kind of refusal an [`AudioError`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// The system could not open or deliver the bytes.
    Io,
    /// There is not a single byte.
    Empty,
    /// No known audio format.
    NotAudio,
    /// A known format or codec that is not read.
    Unsupported,
    /// The bytes contradict their format.
    Corrupt,
}

impl Verdict {
    /// Stable short code for outcome tables: `io`, `empty`, `not_audio`, `unsupported` or `corrupt`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Io => "io",
            Self::Empty => "empty",
            Self::NotAudio => "not_audio",
            Self::Unsupported => "unsupported",
            Self::Corrupt => "corrupt",
        }
    }
}

impl AudioError {
    /// The kind of refusal.
    pub fn verdict(&self) -> Verdict {
        match self {
            Self::Open { .. } | Self::Io { .. } | Self::NotSeekable => Verdict::Io,
            Self::Empty => Verdict::Empty,
            Self::NotAudio { .. } => Verdict::NotAudio,
            Self::Unsupported { .. } => Verdict::Unsupported,
            Self::Corrupt { .. } => Verdict::Corrupt,
        }
    }

    /// The byte of the file that the error is about, where it has one.
    pub fn offset(&self) -> Option<u64> {
        match self {
            Self::Io { offset, .. }
            | Self::Unsupported { offset, .. }
            | Self::Corrupt { offset, .. } => Some(*offset),
            Self::NotAudio { .. } => Some(0),
            Self::Open { .. } | Self::Empty | Self::NotSeekable => None,
        }
    }

    pub(crate) fn corrupt(offset: u64, actual: impl Into<String>, expected: &'static str) -> Self {
        Self::Corrupt { offset, actual: actual.into(), expected }
    }

    pub(crate) fn unsupported(
        offset: u64,
        actual: impl Into<String>,
        expected: &'static str,
    ) -> Self {
        Self::Unsupported { offset, actual: actual.into(), expected }
    }
}
