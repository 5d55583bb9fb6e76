//! Sample-rate conversion.

use corsmal_dsp::Lane;
use corsmal_dsp::resample::{ResType, resample_into, resampled_len};
use ndarray::IntoDimension;
use numpy::{Element, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{Floats, view2, written};
use crate::errors::value_error;
use crate::transform::named;

#[pyfunction]
pub(crate) fn resample<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    orig_sr: f64,
    target_sr: f64,
    res_type: &str,
    fix: bool,
    scale: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let rates = (orig_sr, target_sr, named(res_type)?);
    match y {
        Floats::F32(y) => converted(py, &y, rates, fix, scale),
        Floats::F64(y) => converted(py, &y, rates, fix, scale),
    }
}

fn converted<'py, T: Lane + Element>(
    py: Python<'py>,
    y: &PyReadonlyArrayDyn<'py, T>,
    (orig_sr, target_sr, res_type): (f64, f64, ResType),
    fix: bool,
    scale: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let y = view2(y)?;
    let (channels, n) = y.dim();
    let samples = resampled_len(n, orig_sr, target_sr, res_type, fix).map_err(value_error)?;
    written(py, (channels, samples).into_dimension(), |out| {
        resample_into(y, orig_sr, target_sr, res_type, scale, out)
    })
}
