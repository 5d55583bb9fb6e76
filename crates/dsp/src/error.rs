//! What can be wrong with parameters and arrays.

use thiserror::Error;

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, DspError>;

/// A refusal: says which parameter or array, its value, and what is allowed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum DspError {
    /// A parameter has an impossible value.
    #[error("{name} = {value} is not possible: {allowed}")]
    Parameter {
        /// Name of the parameter, in librosa's vocabulary.
        name: &'static str,
        /// The value that was given.
        value: String,
        /// What is allowed.
        allowed: String,
    },
    /// An array has the wrong shape.
    #[error("{name} has shape {actual:?}, expected {expected}")]
    Shape {
        /// Name of the array argument.
        name: &'static str,
        /// What was expected.
        expected: String,
        /// What was given.
        actual: Vec<usize>,
    },
    /// An array holds NaN or infinite values.
    #[error("{name} holds a non-finite value at index {index}")]
    NonFinite {
        /// Name of the array argument.
        name: &'static str,
        /// Flat index of the first such value.
        index: usize,
    },
    /// The signal is too short for one frame.
    #[error("{name} has {actual} samples, at least {needed} are needed for one frame")]
    TooShort {
        /// Name of the array argument.
        name: &'static str,
        /// Samples given.
        actual: usize,
        /// Samples needed.
        needed: usize,
    },
}

impl DspError {
    /// Shorthand for [`DspError::Parameter`].
    pub fn parameter(
        name: &'static str,
        value: impl std::fmt::Display,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Parameter { name, value: value.to_string(), allowed: allowed.into() }
    }
}
