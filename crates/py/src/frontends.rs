//! Inputs of the compared systems M1 to M6 and of the spectrogram baselines.

use corsmal_dsp::corsmal::{
    M1Stft, M2Mfcc, M3Spectrogram, M4LogMel, M5A34f136, M5VggishPatches, M6Crop, M6Spectrogram,
    Spec9216, Variant, m4_windows as dsp_m4_windows,
};
use corsmal_dsp::librosa::LibrosaVersion;
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::{Floats, into_numpy, view2, view3};
use crate::pool::compute;
use crate::resample::res_type;
use crate::value_error;

type Singles<'py> = PyReadonlyArrayDyn<'py, f32>;

pub(crate) fn librosa_version(name: &str) -> PyResult<LibrosaVersion> {
    match name {
        "0.8" => Ok(LibrosaVersion::V08),
        "0.11" => Ok(LibrosaVersion::V011),
        other => Err(value_error(format!("librosa = {other} is not possible: 0.8 or 0.11"))),
    }
}

/// One channel `[1, n]` to `[96, 96]` in double precision.
#[pyfunction]
fn spec9216<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    fixed_len: Option<usize>,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let plan = Spec9216 { fixed_len, pad_mode: librosa_version(librosa)?.pad_mode() };
    let image = match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            compute(py, || plan.run(y.row(0)))?
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            compute(py, || plan.run(y.row(0)))?
        }
    };
    into_numpy(py, image.map_err(value_error)?)
}

#[pyfunction]
fn m1_stft<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    n_fft: usize,
    hop_length: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M1Stft { n_fft, hop_length });
    into_numpy(py, compute(py, || plan.run(y))?.map_err(value_error)?)
}

#[pyfunction]
fn m2_mfcc<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    padded: bool,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M2Mfcc { librosa: librosa_version(librosa)?, padded });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}

#[pyfunction]
fn m3_spectrogram<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    n_fft: usize,
    hop_length: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M3Spectrogram { n_fft, hop_length });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}

#[pyfunction]
fn m4_logmel<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    variant: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let variant = match variant {
        "code" => Variant::Code,
        "paper" => Variant::Paper,
        other => {
            return Err(value_error(format!("variant = {other} is not possible: code or paper")));
        }
    };
    let y = view2(&y)?;
    into_numpy(py, compute(py, || M4LogMel { variant }.run(y, sr))?.map_err(value_error)?)
}

#[pyfunction]
fn m4_windows<'py>(py: Python<'py>, features: Singles<'py>) -> PyResult<Bound<'py, PyAny>> {
    let features = view3(&features)?;
    into_numpy(py, compute(py, || dsp_m4_windows(features))?)
}

#[pyfunction]
fn m5_a34f136<'py>(py: Python<'py>, y: Singles<'py>, sr: f64) -> PyResult<Bound<'py, PyAny>> {
    let y = view2(&y)?;
    into_numpy(py, compute(py, || M5A34f136::new(sr)?.run(y))?.map_err(value_error)?)
}

#[pyfunction]
fn m5_vggish_patches<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    converter: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M5VggishPatches { res_type: res_type(converter)? });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}

#[pyfunction]
fn m6_spectrogram<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    start: Option<f64>,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let crop = start.map_or(M6Crop::Onset, M6Crop::At);
    let (y, plan) = (view2(&y)?, M6Spectrogram { librosa: librosa_version(librosa)?, crop });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(spec9216, m)?)?;
    m.add_function(wrap_pyfunction!(m1_stft, m)?)?;
    m.add_function(wrap_pyfunction!(m2_mfcc, m)?)?;
    m.add_function(wrap_pyfunction!(m3_spectrogram, m)?)?;
    m.add_function(wrap_pyfunction!(m4_logmel, m)?)?;
    m.add_function(wrap_pyfunction!(m4_windows, m)?)?;
    m.add_function(wrap_pyfunction!(m5_a34f136, m)?)?;
    m.add_function(wrap_pyfunction!(m5_vggish_patches, m)?)?;
    m.add_function(wrap_pyfunction!(m6_spectrogram, m)?)
}
