//! Workers, and the order in which their results reach the output.
//!
//! A worker takes the next span of a recording that was cut, or else the next input. Whoever
//! completes a recording finishes it and hands it over; results are written in the order of the
//! inputs by whichever worker finds the next one ready. Inputs are taken only a few ahead of the
//! one being written, so memory stays bounded.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

use super::plans::{Planned, Plans};
use super::reader::{self, Failed};
use super::sink::{Finished, Member, Sink};
use super::{Options, Progress, RunError, identity_of};
use crate::config::Config;
use crate::engine::{Features, Recording, Span};
use crate::inputs::Input;
use crate::outcome::{Outcome, Status};

/// Inputs in work or waiting to be written, per worker.
const AHEAD: usize = 4;

/// A run in progress.
pub struct Collector<'a> {
    inputs: &'a [Input],
    options: &'a Options,
    progress: &'a dyn Progress,
    stop: &'a AtomicBool,
    plans: Plans,
    /// Folder of temporary files: that of the output.
    folder: PathBuf,
    state: Mutex<State>,
    changed: Condvar,
    sink: Mutex<Sink>,
}

#[derive(Default)]
struct State {
    next: usize,
    written: usize,
    spans: VecDeque<SpanJob>,
    partial: BTreeMap<usize, Partial>,
    ready: BTreeMap<usize, Finished>,
    failed: usize,
    error: Option<RunError>,
}

/// A span of a recording that was cut.
struct SpanJob {
    input: usize,
    index: usize,
    span: Range<u64>,
    planned: Planned,
}

/// A recording of which not all spans are there.
struct Partial {
    outcome: Outcome,
    planned: Planned,
    spans: Vec<Option<Result<Span, Failed>>>,
    missing: usize,
}

enum Work {
    Input(usize),
    Span(SpanJob),
}

impl<'a> Collector<'a> {
    /// A run whose first inputs the sink already has.
    pub fn new(
        inputs: &'a [Input],
        config: &Arc<Config>,
        options: &'a Options,
        progress: &'a dyn Progress,
        stop: &'a AtomicBool,
        sink: Sink,
    ) -> Self {
        let folder = match options.out.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let state = State { next: sink.next, written: sink.next, ..State::default() };
        Self {
            inputs,
            options,
            progress,
            stop,
            plans: Plans::new(config.clone()),
            folder,
            state: Mutex::new(state),
            changed: Condvar::new(),
            sink: Mutex::new(sink),
        }
    }

    /// Runs every worker to the end.
    pub fn work(self) -> Result<Sink, RunError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.options.jobs)
            .build()
            .map_err(|e| RunError::Temporary(std::io::Error::other(e)))?;
        pool.scope(|scope| {
            for _ in 0..self.options.jobs {
                scope.spawn(|_| self.worker());
            }
        });
        let state = self.state.into_inner().unwrap_or_else(|e| e.into_inner());
        match state.error {
            Some(error) => Err(error),
            None => Ok(self.sink.into_inner().unwrap_or_else(|e| e.into_inner())),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|e| e.into_inner())
    }

    fn worker(&self) {
        while let Some(work) = self.take() {
            match work {
                Work::Input(index) => self.input(index),
                Work::Span(job) => self.span(job),
            }
            self.drain();
        }
    }

    /// The next thing to do; waits while too much is unwritten.
    fn take(&self) -> Option<Work> {
        let mut state = self.lock();
        loop {
            if self.stop.load(Ordering::Relaxed) || state.error.is_some() {
                return None;
            }
            if let Some(job) = state.spans.pop_front() {
                return Some(Work::Span(job));
            }
            if state.next < self.inputs.len() {
                if state.next < state.written + AHEAD * self.options.jobs {
                    state.next += 1;
                    return Some(Work::Input(state.next - 1));
                }
            } else if state.written + state.ready.len() + state.partial.len() >= self.inputs.len()
                && state.partial.is_empty()
            {
                return None;
            }
            // A timeout, since a stop from outside notifies nobody.
            let wait = self.changed.wait_timeout(state, Duration::from_millis(50));
            state = wait.unwrap_or_else(|e| e.into_inner()).0;
        }
    }

    /// Opens an input; computes it, or cuts it and computes its first span.
    fn input(&self, index: usize) {
        let input = &self.inputs[index];
        let mut outcome = Outcome::new(&input.id, input.source.to_string(), Status::Ok, "");
        outcome.identity = identity_of(input);
        let mut source = match reader::open(input) {
            Ok(source) => source,
            Err(failed) => return self.fail(index, outcome, failed),
        };
        reader::describe(&mut outcome, source.as_ref());
        let planned = match self.plans.of(source.spec()) {
            Ok(planned) => planned,
            Err(e) => return self.fail(index, outcome, Failed::new(Status::Unsupported, e)),
        };
        let signal = &planned.plan.config.signal;
        let crop = reader::crop(signal, input, source.spec().sample_rate);
        let spans = reader::spans(source.as_ref(), &planned, &crop);
        if let [span] = spans.as_slice() {
            let computed = reader::compute(source.as_mut(), &planned, &crop, span, self.stop);
            reader::describe(&mut outcome, source.as_ref());
            return match computed {
                Ok(None) => {}
                Ok(Some(span)) => self.complete(index, outcome, &planned, vec![Ok(span)]),
                Err(failed) => self.fail(index, outcome, failed),
            };
        }
        let missing = spans.len();
        let partial = Partial {
            outcome,
            planned: planned.clone(),
            spans: (0..missing).map(|_| None).collect(),
            missing,
        };
        let mut state = self.lock();
        state.partial.insert(index, partial);
        state.spans.extend(spans.into_iter().enumerate().map(|(i, span)| SpanJob {
            input: index,
            index: i,
            span,
            planned: planned.clone(),
        }));
        self.changed.notify_all();
    }

    /// Computes one span of a recording that was cut.
    fn span(&self, job: SpanJob) {
        let input = &self.inputs[job.input];
        let mut last = None;
        let computed = reader::open(input).and_then(|mut source| {
            let signal = &job.planned.plan.config.signal;
            let crop = reader::crop(signal, input, source.spec().sample_rate);
            let span = reader::compute(source.as_mut(), &job.planned, &crop, &job.span, self.stop);
            last = Some(source);
            span
        });
        let result = match computed {
            Ok(None) => return,
            Ok(Some(span)) => Ok(span),
            Err(failed) => Err(failed),
        };
        let mut state = self.lock();
        let Some(partial) = state.partial.get_mut(&job.input) else { return };
        if let Some(source) = last {
            reader::describe(&mut partial.outcome, source.as_ref());
        }
        partial.spans[job.index] = Some(result);
        partial.missing -= 1;
        if partial.missing == 0
            && let Some(partial) = state.partial.remove(&job.input)
        {
            drop(state);
            let spans = partial.spans.into_iter().flatten().collect();
            self.complete(job.input, partial.outcome, &partial.planned, spans);
        }
    }

    /// Finishes a recording from its spans.
    fn complete(
        &self,
        index: usize,
        mut outcome: Outcome,
        planned: &Planned,
        spans: Vec<Result<Span, Failed>>,
    ) {
        let plan = &planned.plan;
        let temporary = |e: std::io::Error| {
            Failed::new(Status::Io, format!("temporary file in {}: {e}", self.folder.display()))
        };
        let finish = || -> Result<(Vec<Member>, Option<Vec<f32>>, u64), Failed> {
            let mut recording = Recording::new(plan.clone(), &self.folder);
            for span in spans {
                recording.add(span?).map_err(temporary)?;
            }
            let total = recording.total();
            if total == 0 {
                return Err(Failed::new(Status::Empty, "no samples"));
            }
            if recording.fewest_frames() == 0 {
                let needed = plan.shortest();
                let reason = format!("{total} samples, at least {needed} make one frame");
                return Err(Failed::new(Status::TooShort, reason));
            }
            let features =
                recording.finish().map_err(|e| Failed::new(Status::TooShort, e.to_string()))?;
            Ok(match features {
                Features::Summary(row) => (Vec::new(), Some(row), total),
                Features::Frames(arrays) => {
                    let compression = self.options.compression;
                    let id = &self.inputs[index].id;
                    (Member::of(id, plan, arrays, compression).map_err(temporary)?, None, total)
                }
            })
        };
        match finish() {
            Ok((arrays, row, total)) => {
                outcome.decoded_frames = total;
                if let Some(longest) = plan.longest_transform()
                    && total < longest as u64
                {
                    self.progress.warning(&format!(
                        "{}: {total} samples are shorter than n_fft = {longest}",
                        outcome.id
                    ));
                }
                let row = row.map(|row| (row, plan.summary_names()));
                self.hand_over(index, Finished { outcome, arrays, row });
            }
            Err(failed) => self.fail(index, outcome, failed),
        }
    }

    /// An input without features.
    fn fail(&self, index: usize, mut outcome: Outcome, failed: Failed) {
        outcome.status = failed.status;
        outcome.reason = failed.reason;
        outcome.byte_offset = failed.byte_offset;
        self.hand_over(index, Finished { outcome, arrays: Vec::new(), row: None });
    }

    fn hand_over(&self, index: usize, finished: Finished) {
        self.lock().ready.insert(index, finished);
    }

    /// Writes what is ready, unless another worker is at it.
    fn drain(&self) {
        loop {
            let Ok(mut sink) = self.sink.try_lock() else { return };
            loop {
                let index = sink.next;
                let Some(finished) = self.lock().ready.remove(&index) else { break };
                match sink.write(&self.inputs[index], finished) {
                    Ok(outcome) => self.written(&outcome),
                    Err(error) => {
                        self.lock().error = Some(error);
                        self.changed.notify_all();
                        return;
                    }
                }
            }
            let next = sink.next;
            drop(sink);
            // Another worker may have handed over the next one while we held the lock.
            if !self.lock().ready.contains_key(&next) {
                return;
            }
        }
    }

    fn written(&self, outcome: &Outcome) {
        self.progress.done(outcome);
        let mut state = self.lock();
        state.written += 1;
        if !outcome.status.has_features() {
            state.failed += 1;
            if let Some(limit) = self.options.max_errors
                && state.failed > limit
            {
                let (failed, last) =
                    (state.failed, format!("{}: {}", outcome.path, outcome.reason));
                state.error = Some(RunError::TooManyErrors { failed, limit, last });
            }
        }
        self.changed.notify_all();
    }
}
