//! Mel spectra, decibels, cepstra and deltas.

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::delta::{DeltaMode, DeltaParams, delta as dsp_delta};
use corsmal_dsp::mel::{MelNorm, MelParams, SparseBank, empty_filters, mel_filter};
use corsmal_dsp::mfcc::{DctNorm, MfccParams, mfcc as dsp_mfcc};
use pyo3::prelude::*;

use crate::arrays::{Floats, Matrix, Tensor, into_numpy, view2, view3};
use crate::value_error;

/// Filter bank parameters from the front end: (sr, n_fft, n_mels, fmin, fmax, htk, norm), `norm`
/// being "slaney", "none" or a number in words.
type MelTuple = (f64, usize, usize, f64, Option<f64>, bool, String);

fn mel_params(tuple: MelTuple) -> PyResult<MelParams> {
    let (sr, n_fft, n_mels, fmin, fmax, htk, norm) = tuple;
    let norm = match norm.as_str() {
        "slaney" => MelNorm::Slaney,
        "none" => MelNorm::None,
        number => match number.parse::<f64>() {
            Ok(p) if p > 0.0 => MelNorm::P(p),
            _ => {
                return Err(value_error(format!(
                    "norm = {number} is not possible: 'slaney', None, inf or a positive number"
                )));
            }
        },
    };
    Ok(MelParams { sr, n_fft, n_mels, fmin, fmax, htk, norm })
}

/// The filter bank and whether it has empty rows.
#[pyfunction]
fn mel<'py>(py: Python<'py>, params: MelTuple) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let bank = mel_filter(&mel_params(params)?).map_err(value_error)?;
    let empty = !empty_filters(&bank).is_empty();
    Ok((into_numpy(py, bank)?, empty))
}

/// `bank @ S` and whether the bank has empty rows.
#[pyfunction]
fn apply_mel<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    params: MelTuple,
) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let bank = mel_filter(&mel_params(params)?).map_err(value_error)?;
    let empty = !empty_filters(&bank).is_empty();
    let sparse = SparseBank::new(&bank);
    let result = match s {
        Floats::F32(s) => {
            let s = checked_bins(view3(&s)?, &bank)?;
            Tensor::F32(py.detach(|| sparse.apply(s)))
        }
        Floats::F64(s) => {
            let s = checked_bins(view3(&s)?, &bank)?;
            Tensor::F64(py.detach(|| sparse.apply(s)))
        }
    };
    Ok((result.into_numpy(py)?, empty))
}

fn checked_bins<'a, T>(
    s: ndarray::ArrayView3<'a, T>,
    bank: &ndarray::Array2<f32>,
) -> PyResult<ndarray::ArrayView3<'a, T>> {
    if s.dim().1 == bank.ncols() {
        Ok(s)
    } else {
        let (got, want) = (s.dim().1, bank.ncols());
        Err(value_error(format!("S has {got} bins, expected {want} for this n_fft")))
    }
}

/// Power values to decibels; the clamp is joint over the whole array.
#[pyfunction]
fn power_to_db<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    reference: f64,
    amin: f64,
    top_db: Option<f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let decibel = Decibel { reference, amin, top_db };
    match s {
        Floats::F32(s) => {
            let mut values = s.as_slice()?.to_vec();
            py.detach(|| decibel.power(&mut values)).map_err(value_error)?;
            into_numpy(py, ndarray::Array1::from_vec(values))
        }
        Floats::F64(s) => {
            let mut values = s.as_slice()?.to_vec();
            py.detach(|| decibel.power(&mut values)).map_err(value_error)?;
            into_numpy(py, ndarray::Array1::from_vec(values))
        }
    }
}

/// Cepstral coefficients of a log-mel spectrogram.
#[pyfunction]
fn mfcc<'py>(
    py: Python<'py>,
    log_mel: Floats<'py>,
    n_mfcc: usize,
    dct_type: u8,
    ortho: bool,
    lifter: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let norm = if ortho { DctNorm::Ortho } else { DctNorm::None };
    let params = MfccParams { n_mfcc, dct_type, norm, lifter };
    let result = match log_mel {
        Floats::F32(s) => {
            let s = view3(&s)?;
            Tensor::F32(py.detach(|| dsp_mfcc(s, &params)).map_err(value_error)?)
        }
        Floats::F64(s) => {
            let s = view3(&s)?;
            Tensor::F64(py.detach(|| dsp_mfcc(s, &params)).map_err(value_error)?)
        }
    };
    result.into_numpy(py)
}

/// Derivative of each row along the frames.
#[pyfunction]
fn delta<'py>(
    py: Python<'py>,
    data: Floats<'py>,
    width: usize,
    order: usize,
    mode: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let mode = match mode {
        "interp" => DeltaMode::Interp,
        "nearest" => DeltaMode::Nearest,
        "mirror" => DeltaMode::Mirror,
        "constant" => DeltaMode::Constant,
        "wrap" => DeltaMode::Wrap,
        other => {
            return Err(value_error(format!(
                "mode = {other} is not possible: interp, nearest, mirror, constant or wrap"
            )));
        }
    };
    let params = DeltaParams { width, order, mode };
    let result = match data {
        Floats::F32(d) => {
            let d = view2(&d)?;
            Matrix::F32(py.detach(|| dsp_delta(d, &params)).map_err(value_error)?)
        }
        Floats::F64(d) => {
            let d = view2(&d)?;
            Matrix::F64(py.detach(|| dsp_delta(d, &params)).map_err(value_error)?)
        }
    };
    result.into_numpy(py)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(mel, m)?)?;
    m.add_function(wrap_pyfunction!(apply_mel, m)?)?;
    m.add_function(wrap_pyfunction!(power_to_db, m)?)?;
    m.add_function(wrap_pyfunction!(mfcc, m)?)?;
    m.add_function(wrap_pyfunction!(delta, m)?)
}
