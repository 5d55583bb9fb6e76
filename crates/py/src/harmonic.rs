//! Inverse transform, harmonic-percussive separation, constant-Q features and AF193.

use std::sync::{Arc, Mutex, PoisonError};

use corsmal_dsp::Lane;
use corsmal_dsp::corsmal::af193::{Af193, LENGTH};
use corsmal_dsp::cqt::{
    ChromaCqt, ChromaCqtParams, CqtParams, chroma_cqt as dsp_chroma_cqt, cqt as dsp_cqt,
};
use corsmal_dsp::hpss::{HpssParams, Part, masks as dsp_masks, separate as dsp_separate};
use corsmal_dsp::istft::istft as dsp_istft;
use corsmal_dsp::librosa::LibrosaVersion;
use corsmal_dsp::tonnetz::tonnetz as dsp_tonnetz;
use corsmal_dsp::window::Window;
use ndarray::{Array2, ArrayView2, ArrayView3};
use num_complex::Complex;
use numpy::{Element, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, into_numpy, view2, view3};
use crate::chroma::norm_of;
use crate::frontends::librosa_version;
use crate::pool::compute;
use crate::spectrum::{StftTuple, pad_mode, stft_params};
use crate::value_error;

/// A contiguous complex array from Python, in the precision it came in.
#[derive(FromPyObject)]
enum Complexes<'py> {
    Single(PyReadonlyArrayDyn<'py, Complex<f32>>),
    Double(PyReadonlyArrayDyn<'py, Complex<f64>>),
}

#[pyfunction]
fn istft<'py>(
    py: Python<'py>,
    spectrogram: Complexes<'py>,
    params: StftTuple,
    length: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let params = stft_params(&params)?;
    match spectrogram {
        Complexes::Single(d) => {
            let d = view3(&d)?;
            into_numpy(py, compute(py, || dsp_istft(d, &params, length))?.map_err(value_error)?)
        }
        Complexes::Double(d) => {
            let d = view3(&d)?;
            into_numpy(py, compute(py, || dsp_istft(d, &params, length))?.map_err(value_error)?)
        }
    }
}

/// Separation parameters from the front end: (harmonic kernel, percussive kernel, power, harmonic
/// margin, percussive margin).
type HpssTuple = (usize, usize, f64, f64, f64);

fn hpss_params(tuple: HpssTuple) -> HpssParams {
    let (kernel_harmonic, kernel_percussive, power, margin_harmonic, margin_percussive) = tuple;
    HpssParams { kernel_harmonic, kernel_percussive, power, margin_harmonic, margin_percussive }
}

fn masks_of<'py, T: Lane + Element>(
    py: Python<'py>,
    s: ArrayView3<T>,
    params: HpssTuple,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let params = hpss_params(params);
    let (harmonic, percussive) = compute(py, || dsp_masks(s, &params))?.map_err(value_error)?;
    Ok((into_numpy(py, harmonic)?, into_numpy(py, percussive)?))
}

/// Harmonic and percussive masks of magnitudes `[channels, bins, frames]`.
#[pyfunction]
fn hpss_masks<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    params: HpssTuple,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    match s {
        Floats::F32(s) => masks_of(py, view3(&s)?, params),
        Floats::F64(s) => masks_of(py, view3(&s)?, params),
    }
}

fn separate_parts<'py, T: Lane + Element>(
    py: Python<'py>,
    y: ArrayView2<T>,
    stft: &StftTuple,
    params: HpssTuple,
    mask: bool,
    parts: &[Part],
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let (stft, params) = (stft_params(stft)?, hpss_params(params));
    let separated =
        compute(py, || dsp_separate(y, &stft, &params, mask, parts))?.map_err(value_error)?;
    separated.into_iter().map(|part| into_numpy(py, part)).collect()
}

/// The asked parts of `y [channels, samples]`, harmonic before percussive.
#[pyfunction]
fn separate<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    stft: StftTuple,
    params: HpssTuple,
    mask: bool,
    harmonic: bool,
    percussive: bool,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let mut parts = vec![Part::Harmonic, Part::Percussive];
    parts.retain(|part| if *part == Part::Harmonic { harmonic } else { percussive });
    match y {
        Floats::F32(y) => separate_parts(py, view2(&y)?, &stft, params, mask, &parts),
        Floats::F64(y) => separate_parts(py, view2(&y)?, &stft, params, mask, &parts),
    }
}

/// Transform parameters from the front end: (sr, hop_length, fmin, n_bins, bins_per_octave, tuning,
/// filter_scale, norm, sparsity, window, scale, pad_mode).
type CqtTuple = (f64, usize, f64, usize, usize, f64, f64, Option<f64>, f64, String, bool, String);

fn cqt_params(tuple: CqtTuple) -> PyResult<CqtParams> {
    let (sr, hop_length, fmin, n_bins, bins_per_octave, tuning, ..) = tuple;
    let (.., filter_scale, norm, sparsity, ref window, scale, ref padding) = tuple;
    Ok(CqtParams {
        sr,
        hop_length,
        fmin,
        n_bins,
        bins_per_octave,
        tuning,
        filter_scale,
        norm: norm_of(norm)?,
        sparsity,
        window: window.parse::<Window>().map_err(value_error)?,
        scale,
        pad_mode: pad_mode(padding)?,
        ..CqtParams::new(sr)
    })
}

#[pyfunction]
fn cqt<'py>(py: Python<'py>, y: Floats<'py>, params: CqtTuple) -> PyResult<Bound<'py, PyAny>> {
    let params = cqt_params(params)?;
    each_precision!(py, view2(y), dsp_cqt(y, &params))
}

/// Folding parameters from the front end: (bins_per_octave, n_chroma, fmin, window, threshold,
/// norm).
type ChromaTuple = (usize, usize, f64, Option<Vec<f64>>, Option<f64>, Option<f64>);

fn chroma_params(tuple: ChromaTuple) -> PyResult<ChromaCqtParams> {
    let (bins_per_octave, n_chroma, fmin, window, threshold, norm) = tuple;
    let norm = norm_of(norm)?;
    let base_c = true;
    Ok(ChromaCqtParams { bins_per_octave, n_chroma, fmin, window, base_c, threshold, norm })
}

#[pyfunction]
fn chroma_cqt<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    cqt: CqtTuple,
    chroma: ChromaTuple,
) -> PyResult<Bound<'py, PyAny>> {
    let (cqt, chroma) = (cqt_params(cqt)?, chroma_params(chroma)?);
    each_precision!(py, view2(y), dsp_chroma_cqt(y, &cqt, &chroma))
}

/// Chromagram of constant-Q magnitudes `[channels, n_bins, frames]`.
#[pyfunction]
fn chroma_of_cqt<'py>(
    py: Python<'py>,
    c: Floats<'py>,
    chroma: ChromaTuple,
) -> PyResult<Bound<'py, PyAny>> {
    let params = chroma_params(chroma)?;
    each_precision!(py, view3(c), ChromaCqt::new(c.dim().1, &params)?.of_magnitudes(c))
}

#[pyfunction]
fn tonnetz<'py>(py: Python<'py>, chroma: Floats<'py>) -> PyResult<Bound<'py, PyAny>> {
    each_precision!(py, view3(chroma), dsp_tonnetz(chroma))
}

/// A plan with its sample rate and librosa.
type KeptAf193 = ((f64, LibrosaVersion), Arc<Af193>);

/// The last plan.
static AF193: Mutex<Option<KeptAf193>> = Mutex::new(None);

/// The vectors `[channels, 193]` of `y [channels, samples]`.
#[pyfunction]
fn af193<'py>(
    py: Python<'py>,
    y: PyReadonlyArrayDyn<'py, f32>,
    sr: f64,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, key) = (view2(&y)?, (sr, librosa_version(librosa)?));
    let vectors = compute(py, || {
        let mut last = AF193.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = match &*last {
            Some((made_for, plan)) if *made_for == key => plan.clone(),
            _ => last.insert((key, Arc::new(Af193::of(key.0, key.1)?))).1.clone(),
        };
        drop(last);
        let mut vectors = Array2::zeros((y.nrows(), LENGTH));
        for (y, mut vector) in y.rows().into_iter().zip(vectors.rows_mut()) {
            let computed = plan.compute(y.to_slice().expect("view2 is contiguous"))?;
            vector.assign(&ndarray::aview1(&computed));
        }
        Ok(vectors)
    })?;
    into_numpy(py, vectors.map_err(|e: corsmal_dsp::DspError| value_error(e))?)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(istft, m)?)?;
    m.add_function(wrap_pyfunction!(hpss_masks, m)?)?;
    m.add_function(wrap_pyfunction!(separate, m)?)?;
    m.add_function(wrap_pyfunction!(cqt, m)?)?;
    m.add_function(wrap_pyfunction!(chroma_cqt, m)?)?;
    m.add_function(wrap_pyfunction!(chroma_of_cqt, m)?)?;
    m.add_function(wrap_pyfunction!(tonnetz, m)?)?;
    m.add_function(wrap_pyfunction!(af193, m)?)
}
