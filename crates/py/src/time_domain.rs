//! Zero crossings and levels of the waveform.

use corsmal_dsp::time_domain::{
    FrameParams, ZeroCrossingParams, rms as dsp_rms, rms_of_spectrogram as dsp_rms_of_spectrogram,
    zero_crossing_rate as dsp_zero_crossing_rate,
};
use pyo3::prelude::*;

use crate::arrays::{Floats, each_precision, signal, view3};
use crate::transform::named;

/// `FrameParams` of the Python package.
#[derive(FromPyObject)]
pub(crate) struct Frames {
    frame_length: usize,
    hop_length: usize,
    center: bool,
}

impl From<Frames> for FrameParams {
    fn from(Frames { frame_length, hop_length, center }: Frames) -> Self {
        Self { frame_length, hop_length, center }
    }
}

/// Share of crossings per frame.
#[pyfunction]
pub(crate) fn zero_crossing_rate<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    frame: Frames,
    threshold: f64,
    zero_pos: bool,
    pad: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let frame = frame.into();
    let params = ZeroCrossingParams { threshold, zero_pos, pad };
    each_precision!(py, signal(y), dsp_zero_crossing_rate(y, &frame, &params))
}

/// Level per frame of a waveform.
#[pyfunction]
pub(crate) fn rms<'py>(
    py: Python<'py>,
    y: Floats<'py>,
    frame: Frames,
    padding: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let (frame, padding) = (frame.into(), named(padding)?);
    each_precision!(py, signal(y), dsp_rms(y, &frame, padding))
}

/// Level per frame of a magnitude spectrogram.
#[pyfunction]
pub(crate) fn rms_of_spectrogram<'py>(
    py: Python<'py>,
    s: Floats<'py>,
    frame_length: usize,
) -> PyResult<Bound<'py, PyAny>> {
    each_precision!(py, view3(s), dsp_rms_of_spectrogram(s, frame_length))
}
