//! Windows and the short-time Fourier transform.

use corsmal_dsp::real::all_finite as dsp_all_finite;
use corsmal_dsp::stft::{PadMode, StftParams, spectrogram_into, stft_into};
use corsmal_dsp::window::{Window, get_window as dsp_get_window};
use pyo3::prelude::*;

use crate::arrays::{Floats, filled, into_numpy, signal, view1};
use crate::pool::compute;
use crate::value_error;

/// Transform parameters, all resolved by the front end: (n_fft, hop_length, win_length, window,
/// center, pad_mode).
pub(crate) type StftTuple = (usize, usize, usize, String, bool, String);

/// A padding mode by numpy's name.
pub(crate) fn pad_mode(name: &str) -> PyResult<PadMode> {
    Ok(match name {
        "constant" => PadMode::Constant,
        "edge" => PadMode::Edge,
        "reflect" => PadMode::Reflect,
        "symmetric" => PadMode::Symmetric,
        other => {
            return Err(value_error(format!(
                "pad_mode = {other} is not possible: constant, edge, reflect or symmetric"
            )));
        }
    })
}

/// The checked parameters behind a tuple from Python.
pub(crate) fn stft_params(tuple: &StftTuple) -> PyResult<StftParams> {
    let (n_fft, hop_length, win_length, window, center, pad_mode) = tuple;
    let pad_mode = self::pad_mode(pad_mode)?;
    let params = StftParams {
        n_fft: *n_fft,
        hop_length: *hop_length,
        win_length: *win_length,
        window: window.parse::<Window>().map_err(value_error)?,
        center: *center,
        pad_mode,
    };
    params.check().map_err(value_error)?;
    Ok(params)
}

#[pyfunction]
fn get_window<'py>(
    py: Python<'py>,
    window: &str,
    nx: usize,
    fftbins: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let window: Window = window.parse().map_err(value_error)?;
    into_numpy(
        py,
        ndarray::Array1::from_vec(dsp_get_window(&window, nx, fftbins).map_err(value_error)?),
    )
}

/// Whether all values are finite.
#[pyfunction]
fn all_finite<'py>(py: Python<'py>, array: Floats<'py>) -> PyResult<bool> {
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
fn stft<'py>(py: Python<'py>, y: Floats<'py>, params: StftTuple) -> PyResult<Bound<'py, PyAny>> {
    let params = stft_params(&params)?;
    match y {
        Floats::F32(y) => filled(py, signal(&y)?, &params, |y, out| stft_into(y, &params, out)),
        Floats::F64(y) => filled(py, signal(&y)?, &params, |y, out| stft_into(y, &params, out)),
    }
}

#[pyfunction]
fn spectrogram<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    params: StftTuple,
    power: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let params = stft_params(&params)?;
    match y {
        Floats::F32(y) => {
            filled(py, signal(&y)?, &params, |y, out| spectrogram_into(y, &params, power, out))
        }
        Floats::F64(y) => {
            filled(py, signal(&y)?, &params, |y, out| spectrogram_into(y, &params, power, out))
        }
    }
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(get_window, m)?)?;
    m.add_function(wrap_pyfunction!(all_finite, m)?)?;
    m.add_function(wrap_pyfunction!(stft, m)?)?;
    m.add_function(wrap_pyfunction!(spectrogram, m)?)
}
