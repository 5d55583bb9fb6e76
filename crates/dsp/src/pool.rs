//! Working memory that recordings hand on to each other.

use std::sync::{Mutex, PoisonError};

/// Memory not in use: fresh pages cost more than many a computation on them. Holds as many as were
/// ever in use at once.
pub(crate) struct Pool<W>(Mutex<Vec<W>>);

impl<W> Default for Pool<W> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<W: Default> Pool<W> {
    /// Memory in any state, or new.
    pub fn take(&self) -> W {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Keeps `work` for the next.
    pub fn give_back(&self, work: W) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(work);
    }
}
