//! Windows and the short-time Fourier transform.

use std::str::FromStr;

use corsmal_dsp::real::all_finite as dsp_all_finite;
use corsmal_dsp::stft::{PadMode, StftParams, spectrogram_into, stft_into};
use corsmal_dsp::window::{Window, get_window as dsp_get_window};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use crate::arrays::{Floats, filled, into_numpy, signal, view1};
use crate::pool::compute;
use crate::value_error;

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

/// `StftParams` of the front end, all resolved.
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

#[pyfunction]
pub(crate) fn get_window<'py>(
    py: Python<'py>,
    window: WindowSpec<'py>,
    nx: usize,
    fftbins: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let values = dsp_get_window(&window.window()?, nx, fftbins).map_err(value_error)?;
    into_numpy(py, ndarray::Array1::from_vec(values))
}

/// Whether all values are finite.
#[pyfunction]
pub(crate) fn all_finite<'py>(py: Python<'py>, array: Floats<'py>) -> PyResult<bool> {
    match array {
        Floats::F32(array) => {
            let values = view1(&array)?;
            compute(py, || dsp_all_finite(values))
        }
        Floats::F64(array) => {
            let values = view1(&array)?;
            compute(py, || dsp_all_finite(values))
        }
    }
}

#[pyfunction]
pub(crate) fn stft<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    params: Transform<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let params = params.params()?;
    match y {
        Floats::F32(y) => filled(py, signal(&y)?, &params, |y, out| stft_into(y, &params, out)),
        Floats::F64(y) => filled(py, signal(&y)?, &params, |y, out| stft_into(y, &params, out)),
    }
}

#[pyfunction]
pub(crate) fn spectrogram<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    params: Transform<'py>,
    power: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let params = params.params()?;
    match y {
        Floats::F32(y) => {
            filled(py, signal(&y)?, &params, |y, out| spectrogram_into(y, &params, power, out))
        }
        Floats::F64(y) => {
            filled(py, signal(&y)?, &params, |y, out| spectrogram_into(y, &params, power, out))
        }
    }
}
