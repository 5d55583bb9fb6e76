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
use crate::pool::compute;
use crate::value_error;

type Doubles<'py> = PyReadonlyArrayDyn<'py, f64>;

#[pyfunction]
fn paa_fbank(py: Python<'_>, sr: f64, num_fft: usize) -> PyResult<Bound<'_, PyAny>> {
    into_numpy(py, dsp_paa_fbank(sr, num_fft).map_err(value_error)?)
}

/// `[channels, 34 or 68, frames]`; `frame` is (window, step) in samples.
#[pyfunction]
fn a34_short<'py>(
    py: Python<'py>,
    y: Doubles<'py>,
    sr: f64,
    frame: (usize, usize),
    deltas: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let y = view2(&y)?;
    let run = || {
        let plan = PaaPlan::new(sr, frame.0, frame.1)?;
        y.outer_iter().map(|signal| plan.short_term(signal, deltas)).collect::<Result<Vec<_>, _>>()
    };
    into_numpy(py, stacked(&compute(py, run)?.map_err(value_error)?)?)
}

/// `[channels, 136, windows]`; `frame` and `mid` are (window, step) in samples.
#[pyfunction]
fn a34f136<'py>(
    py: Python<'py>,
    y: Doubles<'py>,
    sr: f64,
    mid: (usize, usize),
    frame: (usize, usize),
) -> PyResult<Bound<'py, PyAny>> {
    let y = view2(&y)?;
    let run = || {
        let plan = PaaPlan::new(sr, frame.0, frame.1)?;
        let mid = MidTerm::from_samples(mid.0, mid.1, frame.0, frame.1)?;
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
fn sk_resize<'py>(
    py: Python<'py>,
    image: Floats<'py>,
    shape: (usize, usize),
    mode: &str,
    anti_aliasing: Option<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    let mode = match mode {
        "reflect" => PadMode::Reflect,
        "symmetric" => PadMode::Symmetric,
        "edge" => PadMode::Edge,
        "constant" => PadMode::Constant,
        other => {
            return Err(value_error(format!(
                "mode = {other} is not possible: reflect, symmetric, edge or constant"
            )));
        }
    };
    let params = ResizeParams { shape, mode, anti_aliasing };
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
fn pca_fit<'py>(
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
fn pca_project<'py>(
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
            "mean has {} and variance {} values, expected {} and {k} for these components",
            mean.len(),
            variance.len(),
            components.ncols()
        )));
    }
    let (mean, explained_variance) = (Array1::from_vec(mean), Array1::from_vec(variance));
    let pca = Pca { mean, components, explained_variance };
    into_numpy(py, compute(py, || pca.project(x, whiten))?.map_err(value_error)?)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(paa_fbank, m)?)?;
    m.add_function(wrap_pyfunction!(a34_short, m)?)?;
    m.add_function(wrap_pyfunction!(a34f136, m)?)?;
    m.add_function(wrap_pyfunction!(sk_resize, m)?)?;
    m.add_function(wrap_pyfunction!(pca_fit, m)?)?;
    m.add_function(wrap_pyfunction!(pca_project, m)?)
}
