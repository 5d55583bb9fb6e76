//! The private extension module `corsmal_feat._core`.
//!
//! Functions take contiguous `[channels, samples]` or `[channels, rows, frames]` arrays; the typed
//! Python front end (`python/corsmal_feat/`) checks, reshapes and gives librosa's signatures. One
//! file per family, each with a `register`. The GIL is released while we compute.

mod arrays;
mod chroma;
mod classifiers;
mod compound;
mod evaluate;
mod extract;
mod frontends;
mod harmonic;
mod mel;
mod onset;
mod pool;
mod resample;
mod scoring;
mod spectral;
mod spectrum;
mod time_domain;

use pyo3::prelude::*;

pyo3::import_exception!(corsmal_feat.errors, ConfigError);
pyo3::import_exception!(corsmal_feat.errors, ModelError);
pyo3::import_exception!(corsmal_feat.errors, ParameterError);
pyo3::import_exception!(corsmal_feat.errors, RunError);

/// A refused model file.
pub(crate) fn model_error(error: impl std::fmt::Display) -> PyErr {
    ModelError::new_err(error.to_string())
}

/// Any of our refusals as `ParameterError` (a `ValueError`).
pub(crate) fn value_error(error: impl std::fmt::Display) -> PyErr {
    ParameterError::new_err(error.to_string())
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    classifiers::register(m)?;
    evaluate::register(m)?;
    scoring::register(m)?;
    spectrum::register(m)?;
    harmonic::register(m)?;
    mel::register(m)?;
    pool::register(m)?;
    time_domain::register(m)?;
    resample::register(m)?;
    compound::register(m)?;
    extract::register(m)?;
    frontends::register(m)?;
    spectral::register(m)?;
    chroma::register(m)?;
    onset::register(m)
}
