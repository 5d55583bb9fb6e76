//! Zero crossings and levels of the waveform.

use corsmal_dsp::time_domain::{
    FrameParams, ZeroCrossingParams, rms as dsp_rms, rms_of_spectrogram as dsp_rms_of_spectrogram,
    zero_crossing_rate as dsp_zero_crossing_rate,
};
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, signal, view3};
use crate::spectrum::pad_mode;

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
    each_precision!(py, signal(y), dsp_zero_crossing_rate(y, &frame, &params))
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
    each_precision!(py, signal(y), dsp_rms(y, &frame, padding))
}

/// Level per frame of a magnitude spectrogram.
#[pyfunction]
fn rms_of_spectrogram<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    frame_length: usize,
) -> PyResult<Bound<'py, PyAny>> {
    each_precision!(py, view3(s), dsp_rms_of_spectrogram(s, frame_length))
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(zero_crossing_rate, m)?)?;
    m.add_function(wrap_pyfunction!(rms, m)?)?;
    m.add_function(wrap_pyfunction!(rms_of_spectrogram, m)?)
}
