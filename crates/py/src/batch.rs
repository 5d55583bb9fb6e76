//! Recordings one by one, for tables of Arrow.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_extract::engine::{FeatureArray, Plan};
use corsmal_extract::inputs::{self, Given, Input, InputSource, Member, Place};
use corsmal_extract::run::{Piece, Recordings, RunError as Stopped};
use corsmal_extract::survey::{Header, headers};
use ndarray::{Array2, Array3};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

use crate::arrays::into_numpy;
use crate::errors::{run_error, value_error};
use crate::extract::{config_of, input_error, interruptible};
use crate::pool::jobs;

/// Where the bytes of a row come from.
#[derive(FromPyObject)]
pub(crate) enum Source {
    /// The bytes themselves.
    Bytes(PyBackedBytes),
    /// A member of an archive: path, archive, offset, size, fault.
    Member(PathBuf, PathBuf, u64, u64, Option<String>),
    /// A file, or the URI of an object.
    Path(PathBuf),
}

impl Source {
    fn known(self) -> PyResult<InputSource> {
        Ok(match self {
            Self::Bytes(bytes) => InputSource::Memory(bytes.as_ref().into()),
            Self::Member(path, archive, offset, size, fault) => {
                let read = |text: String| serde_json::from_str(&text).map_err(value_error);
                let fault = fault.map(read).transpose()?;
                let archive = place_of(archive)?;
                InputSource::Member(Box::new(Member { archive, path, offset, size, fault }))
            }
            Self::Path(path) => match place_of(path)? {
                Place::File(path) => InputSource::at(path),
                Place::Object(object) => InputSource::Object(object),
            },
        })
    }
}

/// A file, or an object of a store by its URI.
fn place_of(path: PathBuf) -> PyResult<Place> {
    match path.to_str().filter(|name| inputs::is_stored(name)) {
        Some(name) => Ok(Place::Object(Arc::new(inputs::object(name).map_err(value_error)?))),
        None => Ok(Place::File(path)),
    }
}

/// A row: id, source, start and end in seconds; the samples of a piece, whose last one may be open.
type Row = (String, Source, Option<f64>, Option<f64>, Option<(u64, Option<u64>)>);

/// The frames of a recording by feature [frames, coefficients, channels].
type Frames<'py> = Vec<Bound<'py, PyAny>>;

/// Outcomes as JSON lines; names of the summary's columns; the summary
/// [rows with features, names]; for each row its frames.
type Columns<'py> = (String, Vec<String>, Bound<'py, PyAny>, Vec<Option<Frames<'py>>>);

/// Computes recordings by one configuration.
#[pyclass(frozen, name = "Recordings", module = "corsmal_feat._core")]
pub(crate) struct PyRecordings(Recordings);

#[pymethods]
impl PyRecordings {
    #[new]
    fn new(config: (String, String), overrides: Vec<String>) -> PyResult<Self> {
        config_of((&config.0, &config.1), &overrides).map(|c| Self(Recordings::new(c)))
    }

    /// The channels that most of `rows` have, where the width of a summary depends on them.
    fn usual_channels(&self, py: Python<'_>, rows: Vec<Row>) -> PyResult<Option<u16>> {
        let (inputs, _) = inputs_of(rows)?;
        let jobs = jobs()?;
        let work =
            |stop: &Arc<AtomicBool>| self.0.usual_channels(&inputs, jobs, stop).map_err(stopped);
        py.detach(|| interruptible(work, &mut |_| Ok(())))
    }

    /// Why recordings cannot be cut into pieces.
    fn piece_refusal(&self) -> Option<String> {
        self.0.piece_refusal()
    }

    /// Computes `rows` with `jobs` threads.
    fn extract<'py>(
        &self,
        py: Python<'py>,
        rows: Vec<Row>,
        channels: Option<u16>,
        jobs: usize,
    ) -> PyResult<Columns<'py>> {
        let (inputs, pieces) = inputs_of(rows)?;
        if let (true, Some(reason)) = (pieces.iter().any(Option::is_some), self.0.piece_refusal()) {
            return Err(value_error(format!("recordings cannot be cut into pieces: {reason}")));
        }
        let work = |stop: &Arc<AtomicBool>| {
            self.0.extract((&inputs, &pieces), channels, jobs, stop).map_err(stopped)
        };
        let batch = py.detach(|| interruptible(work, &mut |_| Ok(())))?;
        let mut outcomes = String::new();
        for outcome in &batch.outcomes {
            outcomes.push_str(&serde_json::to_string(outcome).map_err(value_error)?);
            outcomes.push('\n');
        }
        let width = batch.names.len();
        let shape = (batch.values.len().checked_div(width).unwrap_or(0), width);
        let summary = Array2::from_shape_vec(shape, batch.values).map_err(value_error)?;
        let frames = batch.frames.into_iter().map(|frames| {
            let Some((plan, arrays)) = frames else { return Ok(None) };
            arrays.into_iter().map(|a| frames_of(py, &plan, a)).collect::<PyResult<_>>().map(Some)
        });
        let frames = frames.collect::<PyResult<_>>()?;
        Ok((outcomes, batch.names, into_numpy(py, summary)?, frames))
    }
}

fn stopped(error: Stopped) -> PyErr {
    match error {
        Stopped::Interrupted => PyKeyboardInterrupt::new_err(error.to_string()),
        other => run_error(&other),
    }
}

fn inputs_of(rows: Vec<Row>) -> PyResult<(Vec<Input>, Vec<Piece>)> {
    let input = |(id, source, start, end, piece): Row| {
        let piece = piece.map(|(first, end)| first..end.unwrap_or(u64::MAX));
        Ok((Input { id, source: source.known()?, start, end, labels: Vec::new() }, piece))
    };
    rows.into_iter().map(input).collect()
}

/// The frames of a feature [frames, coefficients, channels].
fn frames_of<'py>(
    py: Python<'py>,
    plan: &Plan,
    feature: FeatureArray,
) -> PyResult<Bound<'py, PyAny>> {
    if feature.complex {
        let name = feature.name;
        let reason =
            format!("{name} is complex, but Arrow has no complex type: set output = magnitude");
        return Err(value_error(reason));
    }
    let shape = (feature.frames, feature.coefficients, plan.channels);
    let values = feature.values.into_vec()?;
    into_numpy(py, Array3::from_shape_vec(shape, values).map_err(value_error)?)
}

/// A recording that names stand for: id, path, where it lies in an archive, start, end, labels.
type Found = (
    String,
    String,
    Option<(PathBuf, u64, u64, Option<String>)>,
    Option<f64>,
    Option<f64>,
    Vec<(String, String)>,
);

/// The recordings that `paths` stand for, and what is to be warned of. Web addresses have their query,
/// which may be a signature: workers need it.
#[pyfunction]
pub(crate) fn collect(
    py: Python<'_>,
    paths: Vec<String>,
) -> PyResult<(Vec<Found>, Option<String>)> {
    let work = |stop: &Arc<AtomicBool>| inputs::collect_until(&paths, stop).map_err(input_error);
    let found = py.detach(|| interruptible(work, &mut |_| Ok(())))?;
    let warning = found.warning();
    let rows = found.inputs.into_iter().map(|input| {
        let path = match &input.source {
            InputSource::Object(object) => object.address(),
            source => source.to_string(),
        };
        let place = match input.source {
            InputSource::Member(member) => {
                let fault = member.fault.as_ref().map(serde_json::to_string);
                let fault = fault.transpose().map_err(value_error)?;
                let archive = match member.archive {
                    Place::File(path) => path,
                    Place::Object(object) => object.address().into(),
                };
                Some((archive, member.offset, member.size, fault))
            }
            _ => None,
        };
        Ok((input.id, path, place, input.start, input.end, input.labels))
    });
    Ok((rows.collect::<PyResult<_>>()?, warning))
}

/// The sample rate and the frames of recordings, by their headers; `None` where these do not say, and where
/// no frame can be gone to.
#[pyfunction]
pub(crate) fn lengths(py: Python<'_>, rows: Vec<Row>) -> PyResult<Vec<Option<(u32, u64)>>> {
    let (inputs, _) = inputs_of(rows)?;
    let work = |stop: &Arc<AtomicBool>| match headers(&inputs, stop) {
        _ if stop.load(Ordering::Relaxed) => Err(PyKeyboardInterrupt::new_err("interrupted")),
        found => Ok(found),
    };
    let found = py.detach(|| interruptible(work, &mut |_| Ok(())))?;
    let known = |header: Header| header.frames.map(|frames| (header.sample_rate, frames));
    Ok(found.into_iter().map(|header| header.and_then(known)).collect())
}

/// Why the stretch in a row would be another than meant: whether there is a column `start` or `end`, whether
/// the row has them, and the columns in which it has numbers.
#[pyfunction]
pub(crate) fn times_refusal(given: (bool, bool, bool), names: Vec<String>) -> Option<String> {
    let (any_column, start, end) = given;
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    inputs::times_refusal(Given { any_column, start, end }, &names)
}

/// Refuses the store of an object where nothing in it can be asked for.
#[pyfunction]
pub(crate) fn require_store(py: Python<'_>, name: &str) -> PyResult<()> {
    inputs::object(name).map_err(value_error)?;
    let work = |stop: &Arc<AtomicBool>| inputs::require_store(name, stop).map_err(input_error);
    py.detach(|| interruptible(work, &mut |_| Ok(())))
}

/// A name as outputs and messages have it: without the query of a web address.
#[pyfunction]
pub(crate) fn shown(name: &str) -> String {
    inputs::shown(name)
}

/// Whether a name is one of a store, and not of a file.
#[pyfunction]
pub(crate) fn is_stored(name: &str) -> bool {
    inputs::is_stored(name)
}
