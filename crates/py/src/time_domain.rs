//! Zero crossings and levels of the waveform.

use corsmal_dsp::time_domain::{
    FrameParams, ZeroCrossingParams, rms as dsp_rms, rms_of_spectrogram as dsp_rms_of_spectrogram,
    zero_crossing_rate as dsp_zero_crossing_rate,
};
use pyo3::prelude::*;

use crate::arrays::{Floats, into_numpy, view2, view3};
use crate::spectrum::pad_mode;
use crate::value_error;

/// Framing from the front end: (frame_length, hop_length, center).
type FrameTuple = (usize, usize, bool);

fn frame_params((frame_length, hop_length, center): FrameTuple) -> FrameParams {
    FrameParams { frame_length, hop_length, center }
}

/// Share of crossings per frame; `crossings` is (threshold, zero_pos, pad).
#[pyfunction]
fn zero_crossing_rate<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    frame: FrameTuple,
    crossings: (f64, bool, bool),
) -> PyResult<Bound<'py, PyAny>> {
    let frame = frame_params(frame);
    let (threshold, zero_pos, pad) = crossings;
    let params = ZeroCrossingParams { threshold, zero_pos, pad };
    let result = match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            py.detach(|| dsp_zero_crossing_rate(y, &frame, &params))
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            py.detach(|| dsp_zero_crossing_rate(y, &frame, &params))
        }
    };
    into_numpy(py, result.map_err(value_error)?)
}

/// Level per frame of a waveform.
#[pyfunction]
fn rms<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    frame: FrameTuple,
    padding: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (frame, padding) = (frame_params(frame), pad_mode(padding)?);
    let result = match y {
        Floats::F32(y) => {
            let y = view2(&y)?;
            py.detach(|| dsp_rms(y, &frame, padding))
        }
        Floats::F64(y) => {
            let y = view2(&y)?;
            py.detach(|| dsp_rms(y, &frame, padding))
        }
    };
    into_numpy(py, result.map_err(value_error)?)
}

/// Level per frame of a magnitude spectrogram.
#[pyfunction]
fn rms_of_spectrogram<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    frame_length: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let result = match s {
        Floats::F32(s) => dsp_rms_of_spectrogram(view3(&s)?, frame_length),
        Floats::F64(s) => dsp_rms_of_spectrogram(view3(&s)?, frame_length),
    };
    into_numpy(py, result.map_err(value_error)?)
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(zero_crossing_rate, m)?)?;
    m.add_function(wrap_pyfunction!(rms, m)?)?;
    m.add_function(wrap_pyfunction!(rms_of_spectrogram, m)?)
}
