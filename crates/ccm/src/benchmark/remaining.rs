//! How far the features are, for people who wait.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use corsmal_extract::run::Progress;
use corsmal_files::outcome::Outcome;

/// Seconds between two lines.
const EVERY: Duration = Duration::from_secs(2);

/// Tells now and then how many recordings are done, and how long the others will take.
pub(super) struct Told<'a> {
    all: usize,
    progress: &'a (dyn Fn(&str) + Sync),
    state: Mutex<State>,
}

struct State {
    /// Recordings of the parts that are done.
    before: usize,
    /// Recordings of this part, those of an interrupted run with them.
    done: usize,
    /// Recordings computed, and since when.
    computed: usize,
    begin: Instant,
    told: Instant,
}

impl<'a> Told<'a> {
    /// Nothing is done of `all` recordings.
    pub(super) fn new(all: usize, progress: &'a (dyn Fn(&str) + Sync)) -> Self {
        let now = Instant::now();
        let state = State { before: 0, done: 0, computed: 0, begin: now, told: now };
        Self { all, progress, state: Mutex::new(state) }
    }

    /// A part of so many recordings is done.
    pub(super) fn part(&self, recordings: usize) {
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        state.before += recordings;
        state.done = 0;
    }
}

impl Progress for Told<'_> {
    fn start(&self, _: usize, done: usize) {
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        state.done = done;
    }

    fn done(&self, _: &Outcome) {
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        state.done += 1;
        state.computed += 1;
        if state.told.elapsed() < EVERY {
            return;
        }
        state.told = Instant::now();
        let each = state.begin.elapsed().as_secs_f64() / state.computed as f64;
        let done = (state.before + state.done).min(self.all);
        let rest = ((self.all - done) as f64 * each).ceil();
        let all = self.all;
        (self.progress)(&format!("features: {done} of {all} recordings, about {rest} s left"));
    }

    fn warning(&self, _: &str) {}
}
