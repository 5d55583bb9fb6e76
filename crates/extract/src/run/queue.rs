//! The order of work: what is taken next, and what waits for its turn.

use std::collections::{BTreeMap, VecDeque};

use corsmal_files::outcome::Outcome;

use super::error::RunError;
use super::output::Finished;
use super::work::SpanJob;
use crate::engine::{Failed, Planned, Recording, Span, Watch};

/// Inputs in work or waiting to be written, per thread.
const AHEAD: usize = 4;

/// What is in work, and what waits.
#[derive(Default)]
pub(super) struct Queue {
    /// Inputs of the run.
    inputs: usize,
    /// Jobs at work.
    pub running: usize,
    pub next: usize,
    pub written: usize,
    pub spans: VecDeque<SpanJob>,
    pub partial: BTreeMap<usize, Partial>,
    pub ready: BTreeMap<usize, Finished>,
    pub failed: usize,
    /// Whether a recording shorter than a transform was met.
    pub warned: bool,
    pub error: Option<RunError>,
}

impl Queue {
    /// A queue whose first `done` inputs are written, `failed` of them without features.
    pub fn new(inputs: usize, done: usize, failed: usize) -> Self {
        Self { inputs, next: done, written: done, failed, ..Self::default() }
    }

    /// The next thing to do for one of `jobs` threads; none while all are at work or too much is
    /// unwritten.
    pub fn next(&mut self, jobs: usize) -> Option<Work> {
        if self.running >= jobs || self.error.is_some() {
            return None;
        }
        // Spans wait for those before them, so they are not computed far ahead either.
        let ahead = self.spans.front().is_some_and(|job| {
            let added = self.partial.get(&job.input).map_or(0, |partial| partial.added);
            job.index >= added + AHEAD * jobs
        });
        if !ahead && let Some(job) = self.spans.pop_front() {
            return Some(Work::Span(job));
        }
        let room = self.next < self.written + AHEAD * jobs;
        if self.next >= self.inputs || !room {
            return None;
        }
        self.next += 1;
        Some(Work::Input(self.next - 1))
    }
}

/// A recording of which not all spans are there.
pub(super) struct Partial {
    pub outcome: Outcome,
    pub planned: Planned,
    pub watch: Watch,
    /// Number of spans, and of those that are added.
    pub spans: usize,
    pub added: usize,
    /// Spans computed before their turn, each in parts.
    pub early: BTreeMap<usize, Result<Vec<Span>, Failed>>,
    /// `None` while a job adds to it.
    pub recording: Option<Result<Recording, Failed>>,
}

/// The next thing to do.
pub(super) enum Work {
    Input(usize),
    Span(SpanJob),
}
