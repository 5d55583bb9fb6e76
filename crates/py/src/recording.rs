//! Recordings, read piece by piece.

use std::io::Cursor;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use corsmal_audio::{AudioError, BlockSource, from_seekable, open};
use ndarray::Array2;
use pyo3::prelude::*;

use crate::arrays::into_numpy;
use crate::errors::{DecodeError, value_error};

/// Frames decoded at a time: what a header promises is not taken as a size.
const BLOCK: usize = 1 << 16;

fn decode_error(error: AudioError) -> PyErr {
    DecodeError::new_err(error.to_string())
}

/// An open recording.
#[pyclass(frozen, name = "Recording", module = "corsmal_feat._core")]
pub(crate) struct PyRecording {
    source: Mutex<Box<dyn BlockSource>>,
    /// What its errors begin with: the path, where it has one.
    place: String,
}

impl PyRecording {
    fn source(&self) -> MutexGuard<'_, Box<dyn BlockSource>> {
        self.source.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn fault(&self, error: AudioError) -> PyErr {
        DecodeError::new_err(format!("{}{error}", self.place))
    }
}

/// Reads up to `frames` frames after the samples that are there.
fn read_into(
    source: &mut dyn BlockSource,
    frames: usize,
    samples: &mut Vec<f32>,
) -> Result<usize, AudioError> {
    let channels = usize::from(source.spec().channels);
    let mut done = 0;
    while done < frames {
        let start = samples.len();
        samples.resize(start + (frames - done).min(BLOCK) * channels, 0.0);
        let read = source.read(&mut samples[start..])?;
        samples.truncate(start + read * channels);
        if read == 0 {
            break;
        }
        done += read;
    }
    Ok(done)
}

#[pymethods]
impl PyRecording {
    /// Opens a file by what it holds.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let source = py.detach(|| open(&path)).map_err(decode_error)?;
        Ok(Self { source: Mutex::new(source), place: format!("{}: ", path.display()) })
    }

    /// Reads a recording that is in memory.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, bytes: Vec<u8>) -> PyResult<Self> {
        let source = py.detach(|| from_seekable(Cursor::new(bytes))).map_err(decode_error)?;
        Ok(Self { source: Mutex::new(source), place: String::new() })
    }

    /// Frames per second.
    #[getter]
    fn sample_rate(&self) -> u32 {
        self.source().spec().sample_rate
    }

    #[getter]
    fn channels(&self) -> u16 {
        self.source().spec().channels
    }

    /// Goes forward by `frames`, at most to the end.
    fn skip(&self, py: Python<'_>, frames: u64) -> PyResult<()> {
        let work = || {
            let mut source = self.source();
            let at = source.health().decoded_frames.saturating_add(frames);
            source.go_to(at)
        };
        py.detach(work).map_err(|e| self.fault(e))
    }

    /// The next samples [frames, channels], up to `frames` frames or, without it, to the end.
    #[pyo3(signature = (frames=None))]
    fn read<'py>(&self, py: Python<'py>, frames: Option<usize>) -> PyResult<Bound<'py, PyAny>> {
        let (samples, channels) = py
            .detach(|| {
                let mut source = self.source();
                let channels = usize::from(source.spec().channels);
                let mut samples = Vec::new();
                read_into(&mut **source, frames.unwrap_or(usize::MAX), &mut samples)?;
                Ok((samples, channels))
            })
            .map_err(|e| self.fault(e))?;
        let shape = (samples.len() / channels, channels);
        into_numpy(py, Array2::from_shape_vec(shape, samples).map_err(value_error)?)
    }

    /// Frames left, by reading to the end.
    fn count(&self, py: Python<'_>) -> PyResult<u64> {
        let work = || {
            let mut source = self.source();
            let (mut total, mut dropped) = (0, Vec::new());
            loop {
                dropped.clear();
                match read_into(&mut **source, BLOCK, &mut dropped)? {
                    0 => return Ok(total),
                    read => total += read as u64,
                }
            }
        };
        py.detach(work).map_err(|e| self.fault(e))
    }

    /// Frames by the header, where the end of the file bears it out.
    fn confirmed_frames(&self, py: Python<'_>) -> PyResult<Option<u64>> {
        py.detach(|| self.source().confirmed_frames()).map_err(|e| self.fault(e))
    }

    /// What was odd so far, in words.
    #[getter]
    fn repairs(&self) -> Vec<String> {
        self.source().health().repairs.iter().map(ToString::to_string).collect()
    }
}
