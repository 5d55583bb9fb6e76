//! Onset strength and onset detection.

use corsmal_dsp::onset::{
    OnsetParams, PeakPick, backtrack as dsp_backtrack, detrend as dsp_detrend,
    onset_detect as dsp_onset_detect, onset_rises as dsp_onset_rises,
    onset_strength as dsp_onset_strength,
};
use corsmal_dsp::{DspError, Real};
use ndarray::{ArrayView1, ArrayView2};
use numpy::{Element, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, into_numpy, view2, view3};
use crate::errors::value_error;
use crate::pool::compute;

/// `PeakParams` of the Python package; what is missing is librosa's for the sample rate and hop.
#[derive(FromPyObject)]
pub(crate) struct Peaks {
    pre_max: Option<usize>,
    post_max: Option<usize>,
    pre_avg: Option<usize>,
    post_avg: Option<usize>,
    delta: Option<f64>,
    wait: Option<usize>,
}

/// A spectrogram in dB with an optional one of the same shape and precision to compare with.
struct Compared<'py, T: Element> {
    s: PyReadonlyArrayDyn<'py, T>,
    reference: Option<PyReadonlyArrayDyn<'py, T>>,
}

impl<'py, T: Real + Element> Compared<'py, T> {
    fn new(s: PyReadonlyArrayDyn<'py, T>, reference: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        Ok(Self { s, reference: reference.map(|array| array.extract()).transpose()? })
    }

    fn strength(&self, py: Python<'py>, params: &OnsetParams) -> PyResult<Bound<'py, PyAny>> {
        let (s, reference) = (view3(&self.s)?, self.reference.as_ref().map(view3).transpose()?);
        let envelope = compute(py, || dsp_onset_strength(s, reference, params))?;
        into_numpy(py, envelope.map_err(value_error)?)
    }

    fn rises(&self, py: Python<'py>, params: &OnsetParams) -> PyResult<Bound<'py, PyAny>> {
        let (s, reference) = (view3(&self.s)?, self.reference.as_ref().map(view3).transpose()?);
        let rises = compute(py, || dsp_onset_rises(s, reference, params))?;
        into_numpy(py, rises.map_err(value_error)?)
    }
}

/// Envelope `[channels, frames]`; `center` is the delay in frames, None for a plain analysis.
#[pyfunction]
pub(crate) fn onset_strength<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    reference: Option<Bound<'py, PyAny>>,
    lag: usize,
    max_size: usize,
    center: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let (params, reference) = (OnsetParams { lag, max_size, center }, reference.as_ref());
    match s {
        Floats::F32(s) => Compared::new(s, reference)?.strength(py, &params),
        Floats::F64(s) => Compared::new(s, reference)?.strength(py, &params),
    }
}

/// Rises `[channels, bands, frames - lag]`, for aggregation by a Python function.
#[pyfunction]
pub(crate) fn onset_rises<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    reference: Option<Bound<'py, PyAny>>,
    lag: usize,
    max_size: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (params, reference) = (OnsetParams { lag, max_size, center: None }, reference.as_ref());
    match s {
        Floats::F32(s) => Compared::new(s, reference)?.rises(py, &params),
        Floats::F64(s) => Compared::new(s, reference)?.rises(py, &params),
    }
}

#[pyfunction]
pub(crate) fn detrend<'py>(py: Python<'py>, envelope: Floats<'py>) -> PyResult<Bound<'py, PyAny>> {
    each_precision!(py, view2(envelope), Ok::<_, DspError>(dsp_detrend(envelope)))
}

/// Onset frames of each channel of an envelope `[channels, frames]`.
#[pyfunction]
pub(crate) fn onset_detect(
    py: Python<'_>,
    envelope: Floats<'_>,
    sr: f64,
    hop_length: usize,
    normalize: bool,
    peaks: Peaks,
) -> PyResult<Vec<Vec<usize>>> {
    let defaults = PeakPick::new(sr, hop_length).map_err(value_error)?;
    let pick = PeakPick {
        pre_max: peaks.pre_max.unwrap_or(defaults.pre_max),
        post_max: peaks.post_max.unwrap_or(defaults.post_max),
        pre_avg: peaks.pre_avg.unwrap_or(defaults.pre_avg),
        post_avg: peaks.post_avg.unwrap_or(defaults.post_avg),
        delta: peaks.delta.unwrap_or(defaults.delta),
        wait: peaks.wait.unwrap_or(defaults.wait),
    };
    match envelope {
        Floats::F32(e) => onsets(py, view2(&e)?, normalize, &pick),
        Floats::F64(e) => onsets(py, view2(&e)?, normalize, &pick),
    }
}

fn onsets<T: Real>(
    py: Python<'_>,
    envelope: ArrayView2<T>,
    normalize: bool,
    pick: &PeakPick,
) -> PyResult<Vec<Vec<usize>>> {
    let channel = |row: ArrayView1<T>| dsp_onset_detect(&row.to_vec(), normalize, pick);
    compute(py, || envelope.outer_iter().map(channel).collect::<Result<_, _>>())?
        .map_err(value_error)
}

#[pyfunction]
pub(crate) fn onset_backtrack(events: Vec<usize>, energy: Floats<'_>) -> PyResult<Vec<usize>> {
    Ok(match energy {
        Floats::F32(energy) => dsp_backtrack(&events, energy.as_slice()?),
        Floats::F64(energy) => dsp_backtrack(&events, energy.as_slice()?),
    })
}
