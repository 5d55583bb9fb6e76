//! Compound inputs of the benchmark's systems: pyAudioAnalysis features, resized spectrograms,
//! principal components.

use corsmal_dsp::corsmal::paa::{MidTerm, PaaPlan, paa_fbank as dsp_paa_fbank};
use corsmal_dsp::pca::Pca;
use corsmal_dsp::resize::{ResizeParams, resize};
use corsmal_dsp::stft::PadMode;
use ndarray::{Array1, Array2, Array3, Axis};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::{Floats, Matrix, into_numpy, view2};
use crate::errors::value_error;
use crate::pool::compute;

type Doubles<'py> = PyReadonlyArrayDyn<'py, f64>;

#[pyfunction]
pub(crate) fn paa_fbank(py: Python<'_>, sr: f64, num_fft: usize) -> PyResult<Bound<'_, PyAny>> {
    into_numpy(py, dsp_paa_fbank(sr, num_fft).map_err(value_error)?)
}

/// `PaaFrames` of the Python package: windows and steps in samples.
#[derive(FromPyObject)]
pub(crate) struct Frames {
    window: usize,
    step: usize,
    mid_window: usize,
    mid_step: usize,
}

/// `[channels, 34 or 68, frames]`; windows and steps are in samples.
#[pyfunction]
pub(crate) fn a34_short<'py>(
    py: Python<'py>,
    y: Doubles<'py>,
    sr: f64,
    window: usize,
    step: usize,
    deltas: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let y = view2(&y)?;
    let run = || {
        let plan = PaaPlan::new(sr, window, step)?;
        y.outer_iter().map(|signal| plan.short_term(signal, deltas)).collect::<Result<Vec<_>, _>>()
    };
    into_numpy(py, stacked(&compute(py, run)?.map_err(value_error)?)?)
}

/// `[channels, 136, windows]`.
#[pyfunction]
pub(crate) fn a34f136<'py>(
    py: Python<'py>,
    y: Doubles<'py>,
    sr: f64,
    frames: Frames,
) -> PyResult<Bound<'py, PyAny>> {
    let y = view2(&y)?;
    let run = || {
        let Frames { window, step, mid_window, mid_step } = frames;
        let plan = PaaPlan::new(sr, window, step)?;
        let mid = MidTerm::from_samples(mid_window, mid_step, window, step)?;
        let windows = |signal| Ok(mid.statistics(plan.short_term(signal, true)?.view()));
        y.outer_iter().map(windows).collect::<corsmal_dsp::Result<Vec<_>>>()
    };
    into_numpy(py, stacked(&compute(py, run)?.map_err(value_error)?)?)
}

fn stacked(parts: &[Array2<f64>]) -> PyResult<Array3<f64>> {
    let views: Vec<_> = parts.iter().map(Array2::view).collect();
    ndarray::stack(Axis(0), &views).map_err(value_error)
}

#[pyfunction]
pub(crate) fn sk_resize<'py>(
    py: Python<'py>,
    image: Floats<'py>,
    rows: usize,
    columns: usize,
    mode: &str,
    anti_aliasing: Option<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    let mode = mode.parse::<PadMode>().map_err(|error| value_error(format!("mode: {error}")))?;
    let params = ResizeParams { shape: (rows, columns), mode, anti_aliasing };
    let result = match image {
        Floats::F32(s) => {
            let s = view2(&s)?;
            Matrix::F32(compute(py, || resize(s, &params))?.map_err(value_error)?)
        }
        Floats::F64(s) => {
            let s = view2(&s)?;
            Matrix::F64(compute(py, || resize(s, &params))?.map_err(value_error)?)
        }
    };
    result.into_numpy(py)
}

/// (components `[k, columns]`, mean `[columns]`, explained variance `[k]`)
#[pyfunction]
pub(crate) fn pca_fit<'py>(
    py: Python<'py>,
    x: Doubles<'py>,
    n_components: usize,
) -> PyResult<[Bound<'py, PyAny>; 3]> {
    let x = view2(&x)?;
    let pca = compute(py, || Pca::fit(x, n_components))?.map_err(value_error)?;
    Ok([
        into_numpy(py, pca.components)?,
        into_numpy(py, pca.mean)?,
        into_numpy(py, pca.explained_variance)?,
    ])
}

/// `x [rows, columns]` in the coordinates of `components [k, columns]`, whitened where `variance`
/// is given.
#[pyfunction]
pub(crate) fn pca_project<'py>(
    py: Python<'py>,
    x: Doubles<'py>,
    components: Doubles<'py>,
    mean: Vec<f64>,
    variance: Option<Vec<f64>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (x, components) = (view2(&x)?, view2(&components)?.to_owned());
    let whiten = variance.is_some();
    let k = components.nrows();
    let variance = variance.unwrap_or_else(|| vec![1.0; k]);
    if mean.len() != components.ncols() || variance.len() != k {
        return Err(value_error(format!(
            "mean has {} values and variance {}, expected {} and {k} for these components",
            mean.len(),
            variance.len(),
            components.ncols()
        )));
    }
    let (mean, explained_variance) = (Array1::from_vec(mean), Array1::from_vec(variance));
    let pca = Pca { mean, components, explained_variance };
    into_numpy(py, compute(py, || pca.project(x, whiten))?.map_err(value_error)?)
}
