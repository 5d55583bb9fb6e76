//! Sample-rate conversion.

use corsmal_dsp::resample::{ResType, resample as dsp_resample};
use pyo3::prelude::*;

use crate::arrays::{Floats, Matrix, view2};
use crate::value_error;

#[pyfunction]
fn resample<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    rates: (f64, f64),
    res_type: &str,
    fix: bool,
    scale: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let res_type = match res_type {
        "soxr_hq" => ResType::SoxrHq,
        "kaiser_best" => ResType::KaiserBest,
        "kaiser_fast" => ResType::KaiserFast,
        other => {
            return Err(value_error(format!(
                "res_type = {other} is not possible: soxr_hq, kaiser_best or kaiser_fast"
            )));
        }
    };
    let (from, to) = rates;
    let result = match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            let run = || dsp_resample(y, from, to, res_type, fix, scale);
            Matrix::F32(py.detach(run).map_err(value_error)?)
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            let run = || dsp_resample(y, from, to, res_type, fix, scale);
            Matrix::F64(py.detach(run).map_err(value_error)?)
        }
    };
    result.into_numpy(py)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(resample, m)?)
}
