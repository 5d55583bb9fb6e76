//! Inverse transform, harmonic-percussive separation, constant-Q features and AF193.

use std::sync::{Arc, Mutex, PoisonError};

use corsmal_dsp::corsmal::af193::{Af193, LENGTH};
use corsmal_dsp::cqt::{
    ChromaCqt, ChromaCqtParams, CqtParams, chroma_cqt as dsp_chroma_cqt, cqt as dsp_cqt,
};
use corsmal_dsp::hpss::{HpssParams, Part, masks as dsp_masks, separate as dsp_separate};
use corsmal_dsp::istft::{istft_into, istft_shape};
use corsmal_dsp::librosa::LibrosaVersion;
use corsmal_dsp::stft::StftParams;
use corsmal_dsp::tonnetz::tonnetz as dsp_tonnetz;
use corsmal_dsp::{Lane, Real};
use ndarray::{Array2, ArrayView2, ArrayView3, IntoDimension, ShapeBuilder};
use num_complex::Complex;
use numpy::{Element, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, into_numpy, view2, view3, written};
use crate::chroma::norm_of;
use crate::errors::value_error;
use crate::pool::compute;
use crate::transform::{Transform, WindowSpec, named};

/// A contiguous complex array from Python, in the precision it came in.
#[derive(FromPyObject)]
pub(crate) enum Complexes<'py> {
    Single(PyReadonlyArrayDyn<'py, Complex<f32>>),
    Double(PyReadonlyArrayDyn<'py, Complex<f64>>),
}

#[pyfunction]
pub(crate) fn istft<'py>(
    py: Python<'py>,
    spectrogram: Complexes<'py>,
    params: Transform<'py>,
    length: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let params = params.params()?;
    match spectrogram {
        Complexes::Single(d) => inverted(py, &d, &params, length),
        Complexes::Double(d) => inverted(py, &d, &params, length),
    }
}

/// The inverse of a spectrogram in C order or, as librosa's, in Fortran order.
fn inverted<'py, T: Real + Element>(
    py: Python<'py>,
    array: &PyReadonlyArrayDyn<'py, Complex<T>>,
    params: &StftParams,
    length: Option<usize>,
) -> PyResult<Bound<'py, PyAny>>
where
    Complex<T>: Element,
{
    let d = match array.shape() {
        &[a, b, c] if !array.is_c_contiguous() && array.is_fortran_contiguous() => {
            ArrayView3::from_shape((a, b, c).f(), array.as_slice()?).map_err(value_error)?
        }
        _ => view3(array)?,
    };
    let shape = istft_shape::<T>(d.dim(), params, length).map_err(value_error)?;
    written(py, shape.into_dimension(), |out| istft_into(d, params, out))
}

/// `HpssParams` of the Python package.
#[derive(FromPyObject)]
pub(crate) struct Separation {
    kernel_harmonic: usize,
    kernel_percussive: usize,
    power: f64,
    margin_harmonic: f64,
    margin_percussive: f64,
}

impl From<Separation> for HpssParams {
    fn from(from: Separation) -> Self {
        let Separation { kernel_harmonic, kernel_percussive, power, .. } = from;
        let Separation { margin_harmonic, margin_percussive, .. } = from;
        Self { kernel_harmonic, kernel_percussive, power, margin_harmonic, margin_percussive }
    }
}

fn masks_of<'py, T: Lane + Element>(
    py: Python<'py>,
    s: ArrayView3<T>,
    params: Separation,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let params = params.into();
    let (harmonic, percussive) = compute(py, || dsp_masks(s, &params))?.map_err(value_error)?;
    Ok((into_numpy(py, harmonic)?, into_numpy(py, percussive)?))
}

/// Harmonic and percussive masks of magnitudes `[channels, bins, frames]`.
#[pyfunction]
pub(crate) fn hpss_masks<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    params: Separation,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    match s {
        Floats::F32(s) => masks_of(py, view3(&s)?, params),
        Floats::F64(s) => masks_of(py, view3(&s)?, params),
    }
}

fn separate_parts<'py, T: Lane + Element>(
    py: Python<'py>,
    y: ArrayView2<T>,
    stft: &Transform<'_>,
    params: Separation,
    mask: bool,
    parts: &[Part],
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let (stft, params) = (stft.params()?, params.into());
    let separated =
        compute(py, || dsp_separate(y, &stft, &params, mask, parts))?.map_err(value_error)?;
    separated.into_iter().map(|part| into_numpy(py, part)).collect()
}

/// The asked parts of `y [channels, samples]`, harmonic before percussive.
#[pyfunction]
pub(crate) fn separate<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    stft: Transform<'py>,
    params: Separation,
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

/// `CqtParams` of the Python package.
#[derive(FromPyObject)]
pub(crate) struct ConstantQ<'py> {
    sr: f64,
    hop_length: usize,
    fmin: f64,
    n_bins: usize,
    bins_per_octave: usize,
    tuning: f64,
    filter_scale: f64,
    norm: Option<f64>,
    sparsity: f64,
    window: WindowSpec<'py>,
    scale: bool,
    pad_mode: String,
}

impl ConstantQ<'_> {
    fn params(&self) -> PyResult<CqtParams> {
        Ok(CqtParams {
            sr: self.sr,
            hop_length: self.hop_length,
            fmin: self.fmin,
            n_bins: self.n_bins,
            bins_per_octave: self.bins_per_octave,
            tuning: self.tuning,
            filter_scale: self.filter_scale,
            norm: norm_of(self.norm)?,
            sparsity: self.sparsity,
            window: self.window.window()?,
            scale: self.scale,
            pad_mode: named(&self.pad_mode)?,
            ..CqtParams::new(self.sr)
        })
    }
}

#[pyfunction]
pub(crate) fn cqt<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    params: ConstantQ<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let params = params.params()?;
    each_precision!(py, view2(y), dsp_cqt(y, &params))
}

/// `CqtChromaParams` of the Python package.
#[derive(FromPyObject)]
pub(crate) struct Folding {
    bins_per_octave: usize,
    n_chroma: usize,
    fmin: f64,
    window: Option<Vec<f64>>,
    threshold: Option<f64>,
    norm: Option<f64>,
}

impl Folding {
    fn params(self) -> PyResult<ChromaCqtParams> {
        let Self { bins_per_octave, n_chroma, fmin, window, threshold, norm } = self;
        let norm = norm_of(norm)?;
        let base_c = true;
        Ok(ChromaCqtParams { bins_per_octave, n_chroma, fmin, window, base_c, threshold, norm })
    }
}

#[pyfunction]
pub(crate) fn chroma_cqt<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    cqt: ConstantQ<'py>,
    chroma: Folding,
) -> PyResult<Bound<'py, PyAny>> {
    let (cqt, chroma) = (cqt.params()?, chroma.params()?);
    each_precision!(py, view2(y), dsp_chroma_cqt(y, &cqt, &chroma))
}

/// Chromagram of constant-Q magnitudes `[channels, n_bins, frames]`.
#[pyfunction]
pub(crate) fn chroma_of_cqt<'py>(
    py: Python<'py>,
    c: Floats<'py>,
    chroma: Folding,
) -> PyResult<Bound<'py, PyAny>> {
    let params = chroma.params()?;
    each_precision!(py, view3(c), ChromaCqt::new(c.dim().1, &params)?.of_magnitudes(c))
}

#[pyfunction]
pub(crate) fn tonnetz<'py>(py: Python<'py>, chroma: Floats<'py>) -> PyResult<Bound<'py, PyAny>> {
    each_precision!(py, view3(chroma), dsp_tonnetz(chroma))
}

/// A plan with its sample rate and librosa.
type KeptAf193 = ((f64, LibrosaVersion), Arc<Af193>);

/// The last plan.
static AF193: Mutex<Option<KeptAf193>> = Mutex::new(None);

/// The vectors `[channels, 193]` of `y [channels, samples]`.
#[pyfunction]
pub(crate) fn af193<'py>(
    py: Python<'py>,
    y: PyReadonlyArrayDyn<'py, f32>,
    sr: f64,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, key) = (view2(&y)?, (sr, named::<LibrosaVersion>(librosa)?));
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
