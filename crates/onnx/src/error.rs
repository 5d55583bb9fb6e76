//! What can be wrong with libraries, models and what they give.

use std::path::PathBuf;

/// Result with this crate's error.
pub type Result<T> = std::result::Result<T, OnnxError>;

/// Errors name the file, what was found and what is expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OnnxError {
    /// No ONNX Runtime could be loaded.
    #[error(
        "{path}: cannot be loaded as ONNX Runtime: {reason}. The PyPI package onnxruntime has the library: \
         onnxruntime/capi/libonnxruntime.so.VERSION"
    )]
    Library {
        /// The library.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A model that ONNX Runtime does not take, such as one with an unknown operator.
    #[error("{path}: ONNX Runtime refuses this model: {reason}")]
    Model {
        /// The model.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A model that takes or gives something else.
    #[error(
        "{path}: {what}: found {actual}, expected {expected}; docs/vision.md says how to export the model"
    )]
    Interface {
        /// The model.
        path: PathBuf,
        /// Which input or output.
        what: String,
        /// What it is.
        actual: String,
        /// What it should be.
        expected: String,
    },
    /// A model that fails on an input.
    #[error("{path}: the model failed on an input: {reason}")]
    Run {
        /// The model.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}
