//! Mel spectra, decibels, cepstra and deltas.

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::delta::{DeltaMode, DeltaParams, delta as dsp_delta};
use corsmal_dsp::mel::{MelNorm, MelParams, SparseBank, empty_filters, mel_filter};
use corsmal_dsp::melspectrogram::melspectrogram as dsp_melspectrogram;
use corsmal_dsp::mfcc::{DctNorm, MfccParams, mfcc as dsp_mfcc};
use ndarray::Array1;
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, into_numpy, signal, view1, view2, view3};
use crate::spectrum::{StftTuple, stft_params};
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

/// The filter bank without its zeros, and whether it has empty rows.
fn sparse(params: MelTuple) -> PyResult<(SparseBank, bool)> {
    let bank = mel_filter(&mel_params(params)?).map_err(value_error)?;
    Ok((SparseBank::new(&bank), !empty_filters(&bank).is_empty()))
}

/// `bank @ S` and whether the bank has empty rows.
#[pyfunction]
fn apply_mel<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    params: MelTuple,
) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let (bank, empty) = sparse(params)?;
    Ok((each_precision!(py, view3(s), bank.product(s))?, empty))
}

/// `bank @ |stft(y)|^power` and whether the bank has empty rows.
#[pyfunction]
fn melspectrogram<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    stft: StftTuple,
    power: f64,
    params: MelTuple,
) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let (stft, (bank, empty)) = (stft_params(&stft)?, sparse(params)?);
    Ok((each_precision!(py, signal(y), dsp_melspectrogram(y, &stft, power, &bank))?, empty))
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
    each_precision!(py, view1(s), decibel.of(s).map(Array1::from_vec))
}

/// Cepstral coefficients of a log-mel spectrogram; `params` is (n_mfcc, dct_type, ortho, lifter).
#[pyfunction]
fn mfcc<'py>(
    py: Python<'py>,
    log_mel: Floats<'py>,
    params: (usize, u8, bool, f64),
) -> PyResult<Bound<'py, PyAny>> {
    let (n_mfcc, dct_type, ortho, lifter) = params;
    let norm = if ortho { DctNorm::Ortho } else { DctNorm::None };
    let params = MfccParams { n_mfcc, dct_type, norm, lifter };
    each_precision!(py, view3(log_mel), dsp_mfcc(log_mel, &params))
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
    each_precision!(py, view2(data), dsp_delta(data, &params))
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(mel, m)?)?;
    m.add_function(wrap_pyfunction!(apply_mel, m)?)?;
    m.add_function(wrap_pyfunction!(melspectrogram, m)?)?;
    m.add_function(wrap_pyfunction!(power_to_db, m)?)?;
    m.add_function(wrap_pyfunction!(mfcc, m)?)?;
    m.add_function(wrap_pyfunction!(delta, m)?)
}
