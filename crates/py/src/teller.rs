//! A training's progress.

use corsmal_nets::fit::Progress;
use pyo3::prelude::*;

/// Tells Python's function of a training's progress, and ends the training with the first exception.
pub(crate) struct Teller {
    progress: Option<Py<PyAny>>,
    raised: Option<PyErr>,
}

impl Teller {
    /// Calls `progress` with epochs done, epochs in all, last loss, last score, seconds left.
    pub(crate) fn new(progress: Option<Py<PyAny>>) -> Self {
        Self { progress, raised: None }
    }

    /// Whether the training goes on.
    pub(crate) fn tell(&mut self, told: Progress<'_>) -> bool {
        let result = Python::attach(|py| {
            py.check_signals()?;
            let Some(progress) = self.progress.as_ref().filter(|_| told.step.is_none()) else {
                return Ok(());
            };
            let last = told.epochs.last();
            let arguments = (
                told.epochs.len(),
                told.total,
                last.map(|e| e.loss),
                last.and_then(|e| e.score),
                told.left.as_secs_f64(),
            );
            progress.call1(py, arguments).map(|_| ())
        });
        self.raised = result.err();
        self.raised.is_none()
    }

    /// The exception that ended the training.
    pub(crate) fn end(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}
