//! Per-channel energy normalisation.

use corsmal_dsp::Real;
use corsmal_dsp::pcen::{Pcen, PcenParams};
use numpy::{Element, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{Floats, into_numpy, view2, view3};
use crate::errors::value_error;
use crate::pool::compute;

/// Parameters of the Python package, in librosa's names.
#[derive(FromPyObject)]
pub(crate) struct PcenKeys {
    sr: f64,
    hop_length: usize,
    gain: f64,
    bias: f64,
    power: f64,
    time_constant: f64,
    eps: f64,
    b: Option<f64>,
    max_size: usize,
}

/// A result in double precision and the state behind it.
type Normalised<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// `[channels, bands, frames]` of a spectrogram, and the states `[channels, bands]` behind it.
/// `reference`, of the same shape and precision, is smoothed in its place; `zi` is a state.
#[pyfunction]
pub(crate) fn pcen<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    reference: Option<Bound<'py, PyAny>>,
    zi: Option<PyReadonlyArrayDyn<'py, f64>>,
    keys: PcenKeys,
) -> PyResult<Normalised<'py>> {
    let PcenKeys { gain, bias, power, time_constant, eps, b, max_size, .. } = keys;
    let params = PcenParams { gain, bias, power, time_constant, eps, b, max_size };
    let plan = Pcen::new(&params, keys.sr, keys.hop_length).map_err(value_error)?;
    match s {
        Floats::F32(s) => normalised(py, &plan, &s, reference, zi),
        Floats::F64(s) => normalised(py, &plan, &s, reference, zi),
    }
}

fn normalised<'py, T: Real + Element>(
    py: Python<'py>,
    plan: &Pcen,
    s: &PyReadonlyArrayDyn<'py, T>,
    reference: Option<Bound<'py, PyAny>>,
    zi: Option<PyReadonlyArrayDyn<'py, f64>>,
) -> PyResult<Normalised<'py>> {
    let reference: Option<PyReadonlyArrayDyn<'py, T>> =
        reference.map(|array| array.extract()).transpose()?;
    let levels = reference.as_ref().map(view3).transpose()?;
    let (s, state) = (view3(s)?, zi.as_ref().map(view2).transpose()?);
    let (out, end) = compute(py, || plan.of(s, levels, state))?.map_err(value_error)?;
    Ok((into_numpy(py, out)?, into_numpy(py, end)?))
}
