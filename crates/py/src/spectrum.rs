//! Windows and the short-time Fourier transform.

use corsmal_dsp::stft::{PadMode, StftParams, spectrogram as dsp_spectrogram, stft as dsp_stft};
use corsmal_dsp::window::{Window, get_window as dsp_get_window};
use pyo3::prelude::*;

use crate::arrays::{Floats, Tensor, into_numpy, view2};
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
    into_numpy(py, ndarray::Array1::from_vec(dsp_get_window(window, nx, fftbins)))
}

#[pyfunction]
fn stft<'py>(py: Python<'py>, y: Floats<'py>, params: StftTuple) -> PyResult<Bound<'py, PyAny>> {
    let params = stft_params(&params)?;
    match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            into_numpy(py, py.detach(|| dsp_stft(y, &params)).map_err(value_error)?)
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            into_numpy(py, py.detach(|| dsp_stft(y, &params)).map_err(value_error)?)
        }
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
    let result = match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            Tensor::F32(py.detach(|| dsp_spectrogram(y, &params, power)).map_err(value_error)?)
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            Tensor::F64(py.detach(|| dsp_spectrogram(y, &params, power)).map_err(value_error)?)
        }
    };
    result.into_numpy(py)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(get_window, m)?)?;
    m.add_function(wrap_pyfunction!(stft, m)?)?;
    m.add_function(wrap_pyfunction!(spectrogram, m)?)
}
