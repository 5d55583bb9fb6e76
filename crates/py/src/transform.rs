//! What the Python package says of windows and transforms.

use std::str::FromStr;

use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::window::Window;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use crate::errors::value_error;

/// The choice that a text from Python names.
pub(crate) fn named<T: FromStr<Err: std::fmt::Display>>(name: &str) -> PyResult<T> {
    name.parse().map_err(value_error)
}

/// A window by its name with parameters, or as values.
#[derive(FromPyObject)]
pub(crate) enum WindowSpec<'py> {
    Name(String),
    Samples(PyReadonlyArray1<'py, f64>),
}

impl WindowSpec<'_> {
    pub(crate) fn window(&self) -> PyResult<Window> {
        match self {
            Self::Name(name) => named(name),
            Self::Samples(values) => Ok(Window::Samples(values.as_slice()?.to_vec().into())),
        }
    }
}

/// `StftParams` of the Python package, all resolved.
#[derive(FromPyObject)]
pub(crate) struct Transform<'py> {
    n_fft: usize,
    hop_length: usize,
    win_length: usize,
    window: WindowSpec<'py>,
    center: bool,
    pad_mode: String,
}

impl Transform<'_> {
    /// The checked parameters.
    pub(crate) fn params(&self) -> PyResult<StftParams> {
        let params = StftParams {
            n_fft: self.n_fft,
            hop_length: self.hop_length,
            win_length: self.win_length,
            window: self.window.window()?,
            center: self.center,
            pad_mode: named::<PadMode>(&self.pad_mode)?,
        };
        params.check().map_err(value_error)?;
        Ok(params)
    }
}
