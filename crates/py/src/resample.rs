//! Sample-rate conversion.

use corsmal_dsp::resample::{ResType, resample as dsp_resample};
use pyo3::prelude::*;

use crate::arrays::{Floats, Matrix, view2};
use crate::errors::value_error;
use crate::pool::compute;
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
    let res_type: ResType = named(res_type)?;
    let result = match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            let run = || dsp_resample(y, orig_sr, target_sr, res_type, fix, scale);
            Matrix::F32(compute(py, run)?.map_err(value_error)?)
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            let run = || dsp_resample(y, orig_sr, target_sr, res_type, fix, scale);
            Matrix::F64(compute(py, run)?.map_err(value_error)?)
        }
    };
    result.into_numpy(py)
}
