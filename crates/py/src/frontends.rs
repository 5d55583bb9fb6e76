//! Inputs of the compared systems M1 to M6 and of the spectrogram baselines.

use corsmal_dsp::corsmal::{
    M1Stft, M2Mfcc, M3Spectrogram, M4LogMel, M5A34f136, M5VggishPatches, M6Crop, M6Spectrogram,
    Spec9216, m4_windows as dsp_m4_windows,
};
use corsmal_dsp::librosa::LibrosaVersion;
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::{Floats, into_numpy, view2, view3};
use crate::errors::value_error;
use crate::pool::compute;
use crate::transform::named;

type Singles<'py> = PyReadonlyArrayDyn<'py, f32>;

/// One channel `[1, n]` to `[96, 96]` in double precision.
#[pyfunction]
pub(crate) fn spec9216<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    fixed_len: Option<usize>,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let plan = Spec9216 { fixed_len, pad_mode: named::<LibrosaVersion>(librosa)?.pad_mode() };
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
pub(crate) fn m1_stft<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    n_fft: usize,
    hop_length: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M1Stft { n_fft, hop_length });
    into_numpy(py, compute(py, || plan.run(y))?.map_err(value_error)?)
}

#[pyfunction]
pub(crate) fn m2_mfcc<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    padded: bool,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M2Mfcc { librosa: named(librosa)?, padded });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}

#[pyfunction]
pub(crate) fn m3_spectrogram<'py>(
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
pub(crate) fn m4_logmel<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    variant: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M4LogMel { variant: named(variant)? });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}

#[pyfunction]
pub(crate) fn m4_windows<'py>(
    py: Python<'py>,
    features: Singles<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let features = view3(&features)?;
    into_numpy(py, compute(py, || dsp_m4_windows(features))?)
}

#[pyfunction]
pub(crate) fn m5_a34f136<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let y = view2(&y)?;
    into_numpy(py, compute(py, || M5A34f136::new(sr)?.run(y))?.map_err(value_error)?)
}

#[pyfunction]
pub(crate) fn m5_vggish_patches<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    converter: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (y, plan) = (view2(&y)?, M5VggishPatches { res_type: named(converter)? });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}

#[pyfunction]
pub(crate) fn m6_spectrogram<'py>(
    py: Python<'py>,
    y: Singles<'py>,
    sr: f64,
    start: Option<f64>,
    librosa: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let crop = start.map_or(M6Crop::Onset, M6Crop::At);
    let (y, plan) = (view2(&y)?, M6Spectrogram { librosa: named(librosa)?, crop });
    into_numpy(py, compute(py, || plan.run(y, sr))?.map_err(value_error)?)
}
