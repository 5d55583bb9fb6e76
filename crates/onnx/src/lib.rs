//! Networks that others trained, as ONNX models: what Mask R-CNN sees in frames, and what R(2+1)D-18 makes
//! of them.
//!
//! [`clip`] and [`instances`] turn images into what the models take and what they give into tables;
//! with the feature `runtime`, its module of that name runs them by ONNX Runtime, whose library the user names.

pub mod clip;
mod error;
pub mod instances;
#[cfg(feature = "runtime")]
pub mod runtime;

pub use error::{OnnxError, Result};
