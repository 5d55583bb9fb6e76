//! What keeps a recording from an estimate.

use corsmal_vision::VisionError;

/// Why something could not be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    /// It is not there, or shows nothing to measure.
    Missing(String),
    /// It is there but damaged, or contradicts another file.
    Damaged(String),
}

impl From<VisionError> for Problem {
    fn from(error: VisionError) -> Self {
        match error {
            VisionError::Request(reason) => Self::Missing(reason),
            // Inputs that contradict each other, and files that cannot be read.
            other => Self::Damaged(other.to_string()),
        }
    }
}
