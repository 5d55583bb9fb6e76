//! Why a recording has no features.

use std::io;

use corsmal_audio::{AudioError, Verdict};
use corsmal_dsp::DspError;
use corsmal_files::outcome::Status;

use super::extractor::Refused;

/// Why a recording has no features.
#[derive(Debug)]
pub struct Failed {
    /// The verdict.
    pub status: Status,
    /// In words.
    pub reason: String,
    /// Byte in the file, where known.
    pub byte_offset: Option<u64>,
    /// A temporary file failed, which is not the recording's fault.
    pub temporary: Option<io::Error>,
}

impl Failed {
    /// A failure without a place.
    pub fn new(status: Status, reason: impl Into<String>) -> Self {
        Self { status, reason: reason.into(), byte_offset: None, temporary: None }
    }

    /// The same for something else that was to be computed of the recording.
    pub fn same(&self) -> Self {
        Self { byte_offset: self.byte_offset, ..Self::new(self.status, self.reason.clone()) }
    }

    /// A temporary file failed.
    pub fn temporary(error: io::Error) -> Self {
        let reason = format!("temporary file: {error}");
        Self { temporary: Some(error), ..Self::new(Status::Io, reason) }
    }
}

impl From<AudioError> for Failed {
    fn from(error: AudioError) -> Self {
        let status = match error.verdict() {
            Verdict::Io => Status::Io,
            Verdict::Empty => Status::Empty,
            Verdict::NotAudio => Status::NotAudio,
            Verdict::Unsupported => Status::Unsupported,
            Verdict::Corrupt => Status::Corrupt,
        };
        Self { byte_offset: error.offset(), ..Self::new(status, error.to_string()) }
    }
}

impl From<Refused> for Failed {
    fn from(error: Refused) -> Self {
        let status = match error.source {
            DspError::TooShort { .. } => Status::TooShort,
            _ => Status::Unsupported,
        };
        Self::new(status, error.to_string())
    }
}

/// Why stored values could not be finished.
#[derive(Debug, thiserror::Error)]
pub enum FinishError {
    /// The temporary file failed.
    #[error("temporary file: {0}")]
    Temporary(#[from] io::Error),
    /// A feature needs more frames.
    #[error("{of} has {frames} frames, {feature} needs at least {needed}")]
    TooFewFrames {
        /// The feature.
        feature: String,
        /// The feature whose frames it reads; itself where these are its own.
        of: String,
        /// Frames that there are.
        frames: usize,
        /// Frames needed.
        needed: usize,
    },
}

impl From<FinishError> for Failed {
    fn from(error: FinishError) -> Self {
        match error {
            FinishError::Temporary(source) => Self::temporary(source),
            few @ FinishError::TooFewFrames { .. } => Self::new(Status::TooShort, few.to_string()),
        }
    }
}
