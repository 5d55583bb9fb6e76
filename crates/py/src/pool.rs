//! Threads for functions on arrays.
//!
//! A fork copies memory but no threads: rayon's global pool would wait for ever in the child. So
//! each process has a pool of its own, made when it is first needed.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::value_error;

const VARIABLE: &str = "CORSMAL_FEAT_JOBS";

/// Process, number of threads, threads. Locked only with the GIL held, as `os.fork` does: no child
/// finds it locked.
static POOL: Mutex<Option<(u32, usize, Arc<ThreadPool>)>> = Mutex::new(None);

/// Threads to use where no number is given: `CORSMAL_FEAT_JOBS`, or one for each core.
#[pyfunction]
pub(crate) fn jobs() -> PyResult<usize> {
    match std::env::var(VARIABLE) {
        Err(_) => Ok(std::thread::available_parallelism().map_or(1, usize::from)),
        Ok(text) => text.parse().ok().filter(|jobs| *jobs > 0).ok_or_else(|| {
            value_error(format!("{VARIABLE} must be a whole number of at least 1, not {text}"))
        }),
    }
}

/// The threads of this process.
pub(crate) fn pool(_: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    let (process, jobs) = (std::process::id(), jobs()?);
    let mut slot = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match slot.take() {
        Some(kept) if (kept.0, kept.1) == (process, jobs) => {
            let pool = kept.2.clone();
            *slot = Some(kept);
            return Ok(pool);
        }
        // The parent's: its threads are not here, so nothing must speak to them.
        Some(kept) if kept.0 != process => std::mem::forget(kept),
        _ => {}
    }
    let pool = ThreadPoolBuilder::new().num_threads(jobs).build().map_err(value_error)?;
    let pool = Arc::new(pool);
    *slot = Some((process, jobs, pool.clone()));
    Ok(pool)
}

/// `work` without the GIL, what is parallel in it on the threads of this process.
pub(crate) fn compute<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(py)?;
    Ok(py.detach(|| pool.install(work)))
}
