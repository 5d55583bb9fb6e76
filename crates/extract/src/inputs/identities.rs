//! What the recordings of a list are known by now.

use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::input::Input;
use super::stored;

/// Recordings of stores that are asked for together, before the first of them is needed.
const AHEAD: usize = 256;

/// The identities of a list of recordings, asked for in its order: those of objects many at a time, which
/// is mostly waiting.
pub(crate) struct Identities<'a> {
    inputs: &'a [Input],
    stop: &'a Arc<AtomicBool>,
    pool: Option<rayon::ThreadPool>,
    known: RefCell<(Range<usize>, Vec<String>)>,
}

impl<'a> Identities<'a> {
    pub(crate) fn of(inputs: &'a [Input], stop: &'a Arc<AtomicBool>) -> Self {
        let waits = inputs.iter().any(|input| input.source.is_stored());
        let pool = waits.then(|| stored::pool(stored::LOOKS)).flatten();
        Self { inputs, stop, pool, known: RefCell::default() }
    }

    /// What the recording of this number is known by; empty where it cannot be read. Once the flag is
    /// set, whatever it says counts no more.
    pub(crate) fn get(&self, index: usize) -> String {
        let identity = |input: &Input| input.source.identity_until(self.stop);
        let Some(pool) = &self.pool else {
            return self.inputs.get(index).map(identity).unwrap_or_default();
        };
        let mut known = self.known.borrow_mut();
        if !known.0.contains(&index) {
            let range = index..self.inputs.len().min(index.saturating_add(AHEAD));
            let asked = self.inputs.get(range.clone()).unwrap_or_default();
            *known = (range, pool.install(|| asked.par_iter().map(identity).collect()));
        }
        known.1.get(index - known.0.start).cloned().unwrap_or_default()
    }
}
