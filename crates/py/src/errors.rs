//! The exceptions of `corsmal_feat.errors`, and our refusals as such.

use pyo3::prelude::*;

pyo3::import_exception!(corsmal_feat.errors, ConfigError);
pyo3::import_exception!(corsmal_feat.errors, DecodeError);
pyo3::import_exception!(corsmal_feat.errors, ModelError);
pyo3::import_exception!(corsmal_feat.errors, MissingFileError);
pyo3::import_exception!(corsmal_feat.errors, ParameterError);
pyo3::import_exception!(corsmal_feat.errors, RunError);

/// A refused model file.
pub(crate) fn model_error(error: impl std::fmt::Display) -> PyErr {
    ModelError::new_err(error.to_string())
}

/// A run that could not go on. Its message names options as Python does.
pub(crate) fn run_error(error: &dyn std::fmt::Display) -> PyErr {
    let text = error.to_string();
    let text = text.replace("--overwrite", "overwrite=True").replace("--resume", "resume=True");
    RunError::new_err(text)
}

/// Any of our refusals as `ParameterError` (a `ValueError`).
pub(crate) fn value_error(error: impl std::fmt::Display) -> PyErr {
    ParameterError::new_err(error.to_string())
}
