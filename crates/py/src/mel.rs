//! Mel spectra, decibels, cepstra and deltas.

use corsmal_dsp::Real;
use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::delta::{DeltaParams, delta as dsp_delta};
use corsmal_dsp::mel::{MelParams, SparseBank, empty_filters, mel_filter};
use corsmal_dsp::melspectrogram::melspectrogram as dsp_melspectrogram;
use corsmal_dsp::mfcc::{DctNorm, MfccParams, mfcc as dsp_mfcc};
use ndarray::Ix1;
use numpy::Element;
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, into_numpy, signal, view1, view2, view3, written};
use crate::errors::value_error;
use crate::transform::{Transform, named};

/// `MelParams` of the Python package; `norm` is "slaney", "none" or a number in words.
#[derive(FromPyObject)]
pub(crate) struct Bank {
    sr: f64,
    n_fft: usize,
    n_mels: usize,
    fmin: f64,
    fmax: Option<f64>,
    htk: bool,
    norm: String,
}

impl Bank {
    fn params(self) -> PyResult<MelParams> {
        let Self { sr, n_fft, n_mels, fmin, fmax, htk, norm } = self;
        Ok(MelParams { sr, n_fft, n_mels, fmin, fmax, htk, norm: named(&norm)? })
    }
}

/// The filter bank and whether it has empty rows.
#[pyfunction]
pub(crate) fn mel<'py>(py: Python<'py>, params: Bank) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let bank = mel_filter(&params.params()?).map_err(value_error)?;
    let empty = !empty_filters(&bank).is_empty();
    Ok((into_numpy(py, bank)?, empty))
}

/// The filter bank without its zeros, and whether it has empty rows.
fn sparse(params: Bank) -> PyResult<(SparseBank, bool)> {
    let bank = mel_filter(&params.params()?).map_err(value_error)?;
    Ok((SparseBank::new(&bank), !empty_filters(&bank).is_empty()))
}

/// `bank @ S` and whether the bank has empty rows.
#[pyfunction]
pub(crate) fn apply_mel<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    params: Bank,
) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let (bank, empty) = sparse(params)?;
    Ok((each_precision!(py, view3(s), bank.product(s))?, empty))
}

/// `bank @ |stft(y)|^power` and whether the bank has empty rows.
#[pyfunction]
pub(crate) fn melspectrogram<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    stft: Transform<'py>,
    power: f64,
    params: Bank,
) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let (stft, (bank, empty)) = (stft.params()?, sparse(params)?);
    Ok((each_precision!(py, signal(y), dsp_melspectrogram(y, &stft, power, &bank))?, empty))
}

/// Power values to decibels; the clamp is joint over the whole array.
#[pyfunction]
pub(crate) fn power_to_db<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    reference: f64,
    amin: f64,
    top_db: Option<f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let decibel = Decibel { reference, amin, top_db };
    match s {
        Floats::F32(s) => decibels(py, view1(&s)?, &decibel),
        Floats::F64(s) => decibels(py, view1(&s)?, &decibel),
    }
}

fn decibels<'py, T: Real + Element>(
    py: Python<'py>,
    values: &[T],
    decibel: &Decibel,
) -> PyResult<Bound<'py, PyAny>> {
    written(py, Ix1(values.len()), |mut out| {
        decibel.write(values, out.as_slice_mut().unwrap_or_default())
    })
}

/// Cepstral coefficients of a log-mel spectrogram.
#[pyfunction]
pub(crate) fn mfcc<'py>(
    py: Python<'py>,
    log_mel: Floats<'py>,
    n_mfcc: usize,
    dct_type: u8,
    ortho: bool,
    lifter: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let norm = if ortho { DctNorm::Ortho } else { DctNorm::None };
    let params = MfccParams { n_mfcc, dct_type, norm, lifter };
    each_precision!(py, view3(log_mel), dsp_mfcc(log_mel, &params))
}

/// Derivative of each row along the frames.
#[pyfunction]
pub(crate) fn delta<'py>(
    py: Python<'py>,
    data: Floats<'py>,
    width: usize,
    order: usize,
    mode: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let mode = named(mode)?;
    let params = DeltaParams { width, order, mode };
    each_precision!(py, view2(data), dsp_delta(data, &params))
}
