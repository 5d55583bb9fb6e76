//! Sample-rate conversion.

use corsmal_dsp::resample::{ResType, resample as dsp_resample};
use pyo3::prelude::*;

use crate::arrays::{Floats, Matrix, view2};
use crate::pool::compute;
use crate::value_error;

/// The converter of librosa's name.
pub(crate) fn res_type(name: &str) -> PyResult<ResType> {
    match name {
        "soxr_hq" => Ok(ResType::SoxrHq),
        "kaiser_best" => Ok(ResType::KaiserBest),
        "kaiser_fast" => Ok(ResType::KaiserFast),
        other => Err(value_error(format!(
            "res_type = {other} is not possible: soxr_hq, kaiser_best or kaiser_fast"
        ))),
    }
}

#[pyfunction]
fn resample<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    rates: (f64, f64),
    res_type: &str,
    fix: bool,
    scale: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let res_type = self::res_type(res_type)?;
    let (from, to) = rates;
    let result = match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            let run = || dsp_resample(y, from, to, res_type, fix, scale);
            Matrix::F32(compute(py, run)?.map_err(value_error)?)
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            let run = || dsp_resample(y, from, to, res_type, fix, scale);
            Matrix::F64(compute(py, run)?.map_err(value_error)?)
        }
    };
    result.into_numpy(py)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(resample, m)?)
}
