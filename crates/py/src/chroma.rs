//! Pitch tracking, tuning and chroma.

use corsmal_dsp::Real;
use corsmal_dsp::chroma::{ChromaParams, chroma as dsp_chroma, chroma_filter as dsp_chroma_filter};
use corsmal_dsp::normalize::Norm;
use corsmal_dsp::pitch::{
    PitchParams, estimate_tuning as dsp_estimate_tuning, piptrack as dsp_piptrack,
    pitch_tuning as dsp_pitch_tuning,
};
use ndarray::{Array2, Array3, ArrayView3};
use numpy::{Element, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, into_numpy, view2, view3};
use crate::errors::value_error;
use crate::pool::compute;

/// `PitchParams` of the Python package.
#[derive(FromPyObject)]
pub(crate) struct Tracker {
    sr: f64,
    n_fft: usize,
    fmin: f64,
    fmax: f64,
    threshold: f64,
}

impl From<Tracker> for PitchParams {
    fn from(Tracker { sr, n_fft, fmin, fmax, threshold }: Tracker) -> Self {
        Self { sr, n_fft, fmin, fmax, threshold }
    }
}

/// `ChromaParams` of the Python package; `norm` is librosa's number.
#[derive(FromPyObject)]
pub(crate) struct Bank {
    sr: f64,
    n_fft: usize,
    n_chroma: usize,
    tuning: f64,
    ctroct: f64,
    octwidth: Option<f64>,
    norm: Option<f64>,
    base_c: bool,
}

/// The norm that librosa's number stands for.
pub(crate) fn norm_of(number: Option<f64>) -> PyResult<Option<Norm>> {
    number.map(Norm::try_from).transpose().map_err(value_error)
}

impl Bank {
    fn params(self) -> PyResult<ChromaParams> {
        let Self { sr, n_fft, n_chroma, tuning, ctroct, octwidth, norm, base_c } = self;
        let norm = norm_of(norm)?;
        Ok(ChromaParams { sr, n_fft, n_chroma, tuning, ctroct, octwidth, norm, base_c })
    }
}

/// A spectrogram with its reference levels `[channels, frames]`, which have the same precision.
struct Spectrogram<'py, T: Element> {
    s: PyReadonlyArrayDyn<'py, T>,
    reference: Option<PyReadonlyArrayDyn<'py, T>>,
}

impl<'py, T: Real + Element> Spectrogram<'py, T> {
    fn new(s: PyReadonlyArrayDyn<'py, T>, reference: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        Ok(Self { s, reference: reference.map(|array| array.extract()).transpose()? })
    }

    fn peaks(&self, py: Python<'py>, params: PitchParams) -> PyResult<PitchesMagnitudes<'py>> {
        let (s, reference) = (view3(&self.s)?, self.reference.as_ref().map(view2).transpose()?);
        let (pitches, magnitudes) =
            compute(py, || dsp_piptrack(s, reference, params))?.map_err(value_error)?;
        Ok((into_numpy(py, pitches)?, into_numpy(py, magnitudes)?))
    }

    fn tuning(
        &self,
        py: Python<'py>,
        params: PitchParams,
        resolution: f64,
        bins_per_octave: usize,
    ) -> PyResult<Option<f64>> {
        let (s, reference) = (view3(&self.s)?, self.reference.as_ref().map(view2).transpose()?);
        compute(py, || dsp_estimate_tuning(s, reference, params, resolution, bins_per_octave))?
            .map_err(value_error)
    }
}

pub(crate) type PitchesMagnitudes<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

#[pyfunction]
pub(crate) fn piptrack<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    reference: Option<Bound<'py, PyAny>>,
    params: Tracker,
) -> PyResult<PitchesMagnitudes<'py>> {
    let (params, reference) = (params.into(), reference.as_ref());
    match s {
        Floats::F32(s) => Spectrogram::new(s, reference)?.peaks(py, params),
        Floats::F64(s) => Spectrogram::new(s, reference)?.peaks(py, params),
    }
}

/// The tuning, or None where there are no peaks.
#[pyfunction]
pub(crate) fn estimate_tuning<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    reference: Option<Bound<'py, PyAny>>,
    params: Tracker,
    resolution: f64,
    bins_per_octave: usize,
) -> PyResult<Option<f64>> {
    let (params, reference) = (params.into(), reference.as_ref());
    let bins = bins_per_octave;
    match s {
        Floats::F32(s) => Spectrogram::new(s, reference)?.tuning(py, params, resolution, bins),
        Floats::F64(s) => Spectrogram::new(s, reference)?.tuning(py, params, resolution, bins),
    }
}

/// The tuning, or None where there are no frequencies.
#[pyfunction]
pub(crate) fn pitch_tuning(
    py: Python<'_>,
    frequencies: Floats<'_>,
    resolution: f64,
    bins_per_octave: usize,
) -> PyResult<Option<f64>> {
    match frequencies {
        Floats::F32(f) => {
            let f = f.as_slice()?;
            compute(py, || dsp_pitch_tuning(f, resolution, bins_per_octave))?
        }
        Floats::F64(f) => {
            let f = f.as_slice()?;
            compute(py, || dsp_pitch_tuning(f, resolution, bins_per_octave))?
        }
    }
    .map_err(value_error)
}

/// The filter bank in double precision; the Python package rounds it.
#[pyfunction]
pub(crate) fn chroma_filter(py: Python<'_>, params: Bank) -> PyResult<Bound<'_, PyAny>> {
    let params = params.params()?;
    into_numpy(py, compute(py, || dsp_chroma_filter::<f64>(&params))?.map_err(value_error)?)
}

/// Chromagram under a filter bank, which is rounded to single precision (as librosa's) unless
/// `double_bank`.
#[pyfunction]
pub(crate) fn chroma<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    params: Bank,
    norm: Option<f64>,
    double_bank: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let (params, norm) = (params.params()?, norm_of(norm)?);
    let bank = dsp_chroma_filter::<f64>(&params).map_err(value_error)?;
    let bank = if double_bank { bank } else { bank.mapv(|w| f64::from(w as f32)) };
    each_precision!(py, view3(s), chroma_of(s, &bank, norm))
}

fn chroma_of<T: Real>(
    s: ArrayView3<T>,
    bank: &Array2<f64>,
    norm: Option<Norm>,
) -> corsmal_dsp::Result<Array3<T>> {
    dsp_chroma(s, bank.mapv(T::of).view(), norm)
}
