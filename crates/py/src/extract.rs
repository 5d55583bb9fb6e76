//! Runs over files, and features of signals in memory.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use corsmal_extract::config::{Config, Preset};
use corsmal_extract::cut::{WINDOW_SECONDS, WindowSpan, into_windows, name_recordings};
use corsmal_extract::engine::{FeatureArray, Features, Signal, Signals};
use corsmal_extract::inputs::{self, InputError};
use corsmal_extract::projection::Projection;
use corsmal_extract::run::{self, Progress, RunOptions};
use corsmal_files::npz::Compression;
use corsmal_files::outcome::Outcome;
use corsmal_files::parquet::ParquetFile;
use corsmal_files::shard::Shard;
use ndarray::{Array1, Array3};
use numpy::PyReadonlyArrayDyn;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::arrays::{into_numpy, view2};
use crate::errors::{MissingFileError, config_error, interrupted, run_error, value_error};
use crate::pool::{self, compute};

/// How often a run asks whether Python has a signal for us.
const POLL: Duration = Duration::from_millis(50);

const FINISHED: &str = "the signal is finished: start another one";

/// The configuration from `(kind, text)`, `kind` being "preset", "path", "toml" or "json".
pub(crate) fn config_of((kind, text): (&str, &str), overrides: &[String]) -> PyResult<Arc<Config>> {
    let config = match kind {
        "preset" => Preset::find(text)
            .and_then(|preset| Config::with_overrides(preset.toml, text, overrides)),
        "path" => Config::load(Path::new(text), overrides),
        "toml" => Config::with_overrides(text, "text", overrides),
        "json" => Config::from_tree(serde_json::from_str(text).map_err(config_error)?, overrides),
        other => return Err(config_error(format!("kind = {other} of a configuration is unknown"))),
    };
    config.map(Arc::new).map_err(config_error)
}

/// The effective configuration as JSON, and its hash.
#[pyfunction]
pub(crate) fn effective_config(
    config: (String, String),
    overrides: Vec<String>,
) -> PyResult<(String, String)> {
    let config = config_of((&config.0, &config.1), &overrides)?;
    Ok((config.to_value().to_string(), config.hash()))
}

/// Keeps for Python how far a run is and what it warns of.
#[derive(Default)]
struct Told {
    done: AtomicUsize,
    inputs: AtomicUsize,
    warnings: Mutex<Vec<String>>,
}

impl Told {
    fn so_far(&self) -> (usize, usize) {
        (self.done.load(Ordering::Relaxed), self.inputs.load(Ordering::Relaxed))
    }
}

impl Progress for Told {
    fn start(&self, inputs: usize, done: usize) {
        self.inputs.store(inputs, Ordering::Relaxed);
        self.done.store(done, Ordering::Relaxed);
    }

    fn done(&self, _: &Outcome) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    fn warning(&self, message: &str) {
        self.warnings.lock().unwrap_or_else(|e| e.into_inner()).push(message.to_string());
    }
}

/// Extracts the features of `paths` into an output, which is made in a work folder where it is for a store
/// (`places`), and gives what is to be warned of.
/// `progress` is called with the recordings done and all of them. An interrupt, or an exception of
/// `progress`, stops the run, its ledger intact.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one private caller, by name")]
pub(crate) fn extract(
    py: Python<'_>,
    paths: Vec<String>,
    config: (String, String),
    overrides: Vec<String>,
    window: Option<(f64, f64)>,
    places: (PathBuf, Option<PathBuf>, Option<String>),
    jobs: Option<usize>,
    resume: bool,
    overwrite: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<String>> {
    let config = config_of((&config.0, &config.1), &overrides)?;
    let jobs = match jobs {
        Some(0) => return Err(value_error("jobs must be at least 1, not 0")),
        Some(jobs) => jobs,
        None => pool::jobs()?,
    };
    let span = window.map(|(window, hop)| WindowSpan { window, hop });
    for (name, seconds) in span.iter().flat_map(|s| [("window", s.window), ("hop", s.hop)]) {
        if !WINDOW_SECONDS.contains(&seconds) {
            let message = format!(
                "{name} must be 0.001 to 1000000 seconds, not {seconds} (hop is half of window by default)"
            );
            return Err(value_error(message));
        }
    }
    let compression = Compression::Stored;
    let shard = "0/1".parse::<Shard>().map_err(value_error)?;
    let (out, work, partition_by) = places;
    let options = RunOptions {
        out,
        work,
        partition_by,
        compression,
        jobs,
        shard,
        resume,
        overwrite,
        max_errors: None,
    };
    if span.is_some() {
        config.check_for_windows().map_err(config_error)?;
    }
    let told = Told::default();
    let work = |stop: &Arc<AtomicBool>| {
        let found = inputs::collect_until(&paths, stop).map_err(input_error)?;
        if let Some(skipped) = found.warning() {
            told.warning(&skipped);
        }
        let inputs = match span {
            None => name_recordings(found.inputs),
            Some(span) => {
                let windows = into_windows(found.inputs, span, stop).map_err(input_error)?;
                windows.warnings().iter().for_each(|warning| told.warning(warning));
                windows.inputs
            }
        };
        run::run(&inputs, &config, &options, &told, stop).map_err(|error| match error {
            run::RunError::Interrupted => interrupted(&error),
            other => run_error(&other),
        })
    };
    let mut last = (0, 0);
    let mut tell = |py: Python<'_>| {
        let (Some(progress), now) = (&progress, told.so_far()) else { return Ok(()) };
        if std::mem::replace(&mut last, now) != now {
            progress.call1(py, now)?;
        }
        Ok(())
    };
    py.detach(|| interruptible(work, &mut tell))?;
    tell(py)?;
    Ok(told.warnings.into_inner().unwrap_or_else(|e| e.into_inner()))
}

/// What is wrong with inputs, or an interrupt.
pub(crate) fn input_error(error: InputError) -> PyErr {
    match error {
        InputError::Stopped => PyKeyboardInterrupt::new_err(error.to_string()),
        InputError::Missing { .. } => MissingFileError::new_err(error.to_string()),
        error => run_error(&error),
    }
}

/// Copies an object of a store into a file.
#[pyfunction]
pub(crate) fn fetch(py: Python<'_>, name: &str, to: PathBuf) -> PyResult<()> {
    let work = |stop: &Arc<AtomicBool>| {
        run::fetch_to(name, &to, stop).map_err(|error| match error {
            run::RunError::Interrupted => interrupted(&error),
            other => run_error(&other),
        })
    };
    py.detach(|| interruptible(work, &mut |_| Ok(())))
}

/// Refuses a Parquet file of ours that does not match the hashes in it, and one that cannot be opened.
#[pyfunction]
pub(crate) fn check_parquet(py: Python<'_>, path: PathBuf) -> PyResult<()> {
    compute(py, || ParquetFile::open(&path)?.check())?.map_err(value_error)
}

/// Fits principal components to the summary of a feature file and writes them to `out`.
#[pyfunction]
pub(crate) fn fit_projection(
    py: Python<'_>,
    features: PathBuf,
    n_components: Option<usize>,
    out: PathBuf,
) -> PyResult<()> {
    compute(py, || Projection::fit(&features, n_components)?.save(&out))?.map_err(value_error)
}

/// Does `work` in another thread; between looks at it this one calls `tell`. Raises the flag of
/// `work` when Python, or `tell`, has an exception.
pub(crate) fn interruptible<T: Send>(
    work: impl FnOnce(&Arc<AtomicBool>) -> PyResult<T> + Send,
    tell: &mut (impl FnMut(Python<'_>) -> PyResult<()> + Send),
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    std::thread::scope(|scope| {
        let (done, finished) = channel::<()>();
        let stop = &stop;
        let worker = scope.spawn(move || {
            // Dropped at the end, however that comes.
            let _done = done;
            work(stop)
        });
        let mut raised = None;
        while finished.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
            if raised.is_none() {
                raised = Python::attach(|py| py.check_signals().and_then(|()| tell(py))).err();
                stop.store(raised.is_some(), Ordering::Relaxed);
            }
        }
        let result = worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        match raised {
            Some(error) => Err(error),
            None => result,
        }
    })
}

/// Features of signals in memory, by one configuration.
#[pyclass(frozen, name = "Signals", module = "corsmal_feat._core")]
pub(crate) struct PySignals(Signals);

#[pymethods]
impl PySignals {
    #[new]
    fn new(config: (String, String), overrides: Vec<String>) -> PyResult<Self> {
        config_of((&config.0, &config.1), &overrides).map(|config| Self(Signals::new(config)))
    }

    /// Begins a signal.
    fn start(&self, py: Python<'_>, sample_rate: u32, channels: u16) -> PyResult<PySignal> {
        let signal = compute(py, || self.0.start(sample_rate, channels))?.map_err(value_error)?;
        Ok(PySignal(Mutex::new(Some(signal))))
    }
}

/// One signal, pushed block by block.
#[pyclass(name = "Signal", module = "corsmal_feat._core")]
pub(crate) struct PySignal(Mutex<Option<Signal>>);

impl PySignal {
    /// Works on the signal while no other thread does. The interpreter is left before the wait, and the pool is
    /// entered after it: a thread that holds the signal may need both.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Option<Signal>) -> T + Send,
    ) -> PyResult<T> {
        let pool = pool::pool(py)?;
        Ok(py.detach(|| {
            let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let signal = &mut *held;
            pool.install(|| work(signal))
        }))
    }
}

#[pymethods]
impl PySignal {
    /// Takes samples [frames, channels].
    fn push(&self, py: Python<'_>, block: PyReadonlyArrayDyn<'_, f32>) -> PyResult<()> {
        let view = view2(&block)?;
        let samples = view.as_slice().ok_or_else(|| value_error("block is not contiguous"))?;
        let pushed = self.with(py, |signal| signal.as_mut().map(|signal| signal.push(samples)))?;
        pushed.ok_or_else(|| value_error(FINISHED))?.map_err(value_error)
    }

    /// Names of the summary's values; empty without a summary.
    fn summary_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let names = |signal: &Signal| signal.plan().summary_names().to_vec();
        self.with(py, |signal| signal.as_ref().map(names))?.ok_or_else(|| value_error(FINISHED))
    }

    /// The summary [values] if there is one, and frame-level features: name, whether values are
    /// pairs of real and imaginary parts, values [frames, coefficients, channels].
    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Finished<'py>> {
        let Some(signal) = self.with(py, Option::take)? else { return Err(value_error(FINISHED)) };
        let channels = signal.plan().channels;
        match compute(py, || signal.finish())?.map_err(value_error)? {
            Features::Summary(row) => {
                Ok((Some(into_numpy(py, Array1::from_vec(row))?), Vec::new()))
            }
            Features::Frames(features) => {
                let numpy = |feature: FeatureArray| {
                    let per_channel = if feature.complex { 2 } else { 1 };
                    let shape = (feature.frames, feature.coefficients, per_channel * channels);
                    let values = feature.values.into_vec()?;
                    let array = Array3::from_shape_vec(shape, values).map_err(value_error)?;
                    Ok((feature.name, feature.complex, into_numpy(py, array)?))
                };
                Ok((None, features.into_iter().map(numpy).collect::<PyResult<_>>()?))
            }
        }
    }
}

pub(crate) type Finished<'py> = (Option<Bound<'py, PyAny>>, Vec<(String, bool, Bound<'py, PyAny>)>);
