//! Working memory that recordings, and parts of one, hand on to each other.

use std::sync::{Mutex, PoisonError};

/// Memory not in use: fresh pages cost more than many a computation on them. Holds as many as were
/// ever in use at once.
pub(crate) struct Pool<W>(Mutex<Vec<W>>);

impl<W> Default for Pool<W> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<W> Pool<W> {
    /// Memory in any state; `None` if all is in use.
    pub fn take(&self) -> Option<W> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }

    /// Keeps `work` for the next.
    pub fn give_back(&self, work: W) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(work);
    }
}
