//! Windows and the short-time Fourier transform.

use corsmal_dsp::real::all_finite as dsp_all_finite;
use corsmal_dsp::stft::{spectrogram_into, stft_into};
use corsmal_dsp::window::get_window as dsp_get_window;
use pyo3::prelude::*;

use crate::arrays::{Floats, filled, into_numpy, signal, view1};
use crate::errors::value_error;
use crate::pool::compute;
use crate::transform::{Transform, WindowSpec};

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
