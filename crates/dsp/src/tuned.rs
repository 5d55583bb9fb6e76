//! Tables that depend on the tuning of a recording, shared between recordings.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;

/// Tables by tuning in hundredths of a bin, the resolution of librosa's estimate.
pub struct ByTuning<P>(Mutex<HashMap<i32, Arc<P>>>);

impl<P> Default for ByTuning<P> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<P> ByTuning<P> {
    /// The table for `tuning`, made if it is the first of its kind.
    ///
    /// # Errors
    /// What `make` returns.
    pub fn get(&self, tuning: f64, make: impl FnOnce() -> Result<P>) -> Result<Arc<P>> {
        let key = (tuning * 100.0).round() as i32;
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(table) = lock().get(&key) {
            return Ok(table.clone());
        }
        // Made outside the lock: two threads may make the same table, and one of them is kept.
        let table = Arc::new(make()?);
        Ok(lock().entry(key).or_insert(table).clone())
    }
}
