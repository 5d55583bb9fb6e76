//! The order of work, and the order in which results reach the output.
//!
//! A job computes one span of a recording that was cut, or else the next input. Whoever completes a
//! recording finishes it and hands it over; results are written in the order of the inputs by
//! whichever job finds the next one ready. Each job starts those that can go on after it, so nobody
//! waits: threads without a job lend a hand to the jobs that split their work, or sleep. Inputs are
//! taken only a few ahead of the one being written, so memory stays bounded.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

use corsmal_files::npz::Compression;
use corsmal_files::outcome::{Outcome, Status};
use rayon::Scope;

use super::check::identity_of;
use super::error::RunError;
use super::options::Progress;
use super::output::{Finished, Member, Output};
use crate::config::Config;
use crate::engine::{Failed, Features, Planned, Plans, Recording, Span, Watch, reading};
use crate::inputs::{Input, InputSource};
use crate::survey::Survey;

/// Inputs in work or waiting to be written, per thread.
const AHEAD: usize = 4;

/// How much is done at a time, and how much may fail.
#[derive(Clone, Copy)]
pub struct Limits {
    /// Threads.
    pub jobs: usize,
    /// Failed files after which to stop.
    pub max_errors: Option<usize>,
    /// How arrays are stored.
    pub compression: Compression,
}

/// A run in progress.
pub struct Collector<'a> {
    inputs: &'a [Input],
    limits: Limits,
    survey: &'a Survey,
    progress: &'a dyn Progress,
    stop: &'a Arc<AtomicBool>,
    plans: Plans<'a>,
    /// Folder of temporary files: that of the output.
    folder: PathBuf,
    state: Mutex<State>,
    output: Mutex<Output>,
}

#[derive(Default)]
struct State {
    /// Jobs at work.
    running: usize,
    next: usize,
    written: usize,
    spans: VecDeque<SpanJob>,
    partial: BTreeMap<usize, Partial>,
    ready: BTreeMap<usize, Finished>,
    failed: usize,
    /// Whether a recording shorter than a transform was met.
    warned: bool,
    error: Option<RunError>,
}

/// A span of a recording that was cut.
struct SpanJob {
    input: usize,
    index: usize,
    span: Range<u64>,
    planned: Planned,
    watch: Watch,
}

/// What a recording gives: arrays, or a row of the table; and its samples.
type Parts = (Vec<Member>, Option<Vec<f32>>, u64);

/// A recording of which not all spans are there.
struct Partial {
    outcome: Outcome,
    planned: Planned,
    watch: Watch,
    /// Number of spans, and of those that are added.
    spans: usize,
    added: usize,
    /// Spans computed before their turn, each in parts.
    early: BTreeMap<usize, Result<Vec<Span>, Failed>>,
    /// `None` while a job adds to it.
    recording: Option<Result<Recording, Failed>>,
}

enum Work {
    Input(usize),
    Span(SpanJob),
}

impl<'a> Collector<'a> {
    /// A run whose first inputs the output already has. Long recordings put temporary files into
    /// `folder`.
    pub fn new(
        inputs: &'a [Input],
        config: &Arc<Config>,
        limits: Limits,
        survey: &'a Survey,
        folder: PathBuf,
        (progress, stop): (&'a dyn Progress, &'a Arc<AtomicBool>),
        output: Output,
    ) -> Self {
        let failed = output.outcomes().iter().filter(|o| !o.status.has_features()).count();
        let state = State { next: output.next, written: output.next, failed, ..State::default() };
        Self {
            inputs,
            limits,
            survey,
            progress,
            stop,
            plans: Plans::new(config.clone(), |warning| progress.warning(warning)),
            folder,
            state: Mutex::new(state),
            output: Mutex::new(output),
        }
    }

    /// Runs every job to the end.
    pub fn work(self) -> Result<Output, RunError> {
        let jobs = self.limits.jobs;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(jobs)
            .build()
            .map_err(|e| RunError::Jobs { jobs, why: e.to_string() })?;
        pool.scope(|scope| self.start(scope));
        let state = self.state.into_inner().unwrap_or_else(|e| e.into_inner());
        match state.error {
            Some(error) => Err(error),
            None => Ok(self.output.into_inner().unwrap_or_else(|e| e.into_inner())),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Starts as many jobs as can be at work now.
    fn start<'s>(&'s self, scope: &Scope<'s>) {
        let mut state = self.lock();
        while let Some(work) = self.next(&mut state) {
            state.running += 1;
            scope.spawn(move |scope| {
                self.job(work, scope);
                self.lock().running -= 1;
                self.start(scope);
            });
        }
    }

    fn job<'s>(&'s self, work: Work, scope: &Scope<'s>) {
        let (input, span) = match &work {
            Work::Input(index) => (*index, None),
            Work::Span(job) => (job.input, Some(job.index)),
        };
        let done = catch_unwind(AssertUnwindSafe(|| match work {
            Work::Input(index) => self.input(index),
            Work::Span(job) => self.span(job, scope),
        }));
        if done.is_err() {
            self.broken(input, span, scope);
        }
        // A fault while writing leaves the output in doubt: the run ends, its ledger intact.
        if catch_unwind(AssertUnwindSafe(|| self.drain(scope))).is_err() {
            self.lock().error.get_or_insert(RunError::Broken);
        }
    }

    /// A fault of this program costs the recording at which it happened, not the run.
    fn broken<'s>(&'s self, input: usize, span: Option<usize>, scope: &Scope<'s>) {
        let failed = broken();
        let mut state = self.lock();
        if let (Some(span), Some(partial)) = (span, state.partial.get_mut(&input)) {
            partial.early.insert(span, Err(failed));
            drop(state);
            return self.join(input, scope);
        }
        drop(state);
        let source = &self.inputs[input];
        let mut outcome = Outcome::new(&source.id, source.source.to_string(), Status::Ok, "");
        outcome.identity = identity_of(source);
        self.fail(input, outcome, failed);
    }

    /// The next thing to do; none while enough are at work or too much is unwritten.
    fn next(&self, state: &mut State) -> Option<Work> {
        let full = state.running >= self.limits.jobs;
        if full || self.stop.load(Ordering::Relaxed) || state.error.is_some() {
            return None;
        }
        // Spans wait for those before them, so they are not computed far ahead either.
        let ahead = state.spans.front().is_some_and(|job| {
            let added = state.partial.get(&job.input).map_or(0, |partial| partial.added);
            job.index >= added + AHEAD * self.limits.jobs
        });
        if !ahead && let Some(job) = state.spans.pop_front() {
            return Some(Work::Span(job));
        }
        let room = state.next < state.written + AHEAD * self.limits.jobs;
        if state.next >= self.inputs.len() || !room {
            return None;
        }
        state.next += 1;
        Some(Work::Input(state.next - 1))
    }

    /// Opens an input; computes it, or cuts it and computes its first span.
    fn input(&self, index: usize) {
        let input = &self.inputs[index];
        let mut outcome = Outcome::new(&input.id, input.source.to_string(), Status::Ok, "");
        let watch = Watch::begin(input);
        outcome.identity = identity_of(input);
        let mut source = match watch.settle(reading::open(input, self.stop)) {
            Ok(source) => source,
            Err(failed) => return self.fail(index, outcome, failed),
        };
        reading::describe(&mut outcome, source.as_ref());
        if let Some(reason) = self.survey.refusal(source.spec().channels) {
            return self.fail(index, outcome, Failed::new(Status::Mismatch, reason));
        }
        let planned = match self.plans.of(source.spec()) {
            Ok(planned) => planned,
            Err(e) => return self.fail(index, outcome, Failed::new(Status::Unsupported, e)),
        };
        let signal = &planned.plan.config.signal;
        let crop = reading::crop(signal, (input.start, input.end), source.spec().sample_rate);
        let spans = reading::spans(source.as_ref(), &planned, &crop);
        let mut recording = Recording::new(planned.plan.clone(), &self.folder);
        if let [span] = spans.as_slice() {
            let decoded = &mut outcome.decoded_frames;
            let span = (&crop, span);
            let computed =
                reading::compute(source.as_mut(), &planned, span, self.stop, decoded, |part| {
                    recording.add(part).map_err(Failed::temporary)
                });
            reading::describe(&mut outcome, source.as_ref());
            return match watch.settle(computed) {
                Ok(false) => {}
                Ok(true) => self.complete(index, outcome, (&planned, &watch), Ok(recording)),
                Err(failed) => self.fail(index, outcome, failed),
            };
        }
        let partial = Partial {
            outcome,
            planned: planned.clone(),
            watch: watch.clone(),
            spans: spans.len(),
            added: 0,
            early: BTreeMap::new(),
            recording: Some(Ok(recording)),
        };
        let mut state = self.lock();
        state.partial.insert(index, partial);
        state.spans.extend(spans.into_iter().enumerate().map(|(i, span)| SpanJob {
            input: index,
            index: i,
            span,
            planned: planned.clone(),
            watch: watch.clone(),
        }));
    }

    /// Computes one span of a recording that was cut.
    fn span<'s>(&'s self, job: SpanJob, scope: &Scope<'s>) {
        let input = &self.inputs[job.input];
        let mut parts = Vec::new();
        let mut last = None;
        let mut decoded = 0;
        let computed = reading::open(input, self.stop).and_then(|source| {
            // The spans before this one were read from the file as it was then.
            job.watch.check()?;
            let signal = &job.planned.plan.config.signal;
            let crop = reading::crop(signal, (input.start, input.end), source.spec().sample_rate);
            let source = last.insert(source).as_mut();
            let (span, decoded) = ((&crop, &job.span), &mut decoded);
            reading::compute(source, &job.planned, span, self.stop, decoded, |part| {
                parts.push(part);
                Ok(())
            })
        });
        let result = match job.watch.settle(computed) {
            Ok(false) => return,
            Ok(true) => Ok(parts),
            Err(failed) => Err(failed),
        };
        let mut state = self.lock();
        if let Some(partial) = state.partial.get_mut(&job.input) {
            if let Some(source) = last {
                reading::describe(&mut partial.outcome, source.as_ref());
            }
            partial.outcome.decoded_frames += decoded;
            partial.early.insert(job.index, result);
        }
        drop(state);
        self.join(job.input, scope);
    }

    /// Adds the spans whose turn it is to their recording, unless another job is at it.
    fn join<'s>(&'s self, index: usize, scope: &Scope<'s>) {
        let mut state = self.lock();
        loop {
            let Some(partial) = state.partial.get_mut(&index) else { return };
            let Some(recording) = partial.recording.take() else { return };
            if partial.added == partial.spans {
                if let Some(partial) = state.partial.remove(&index) {
                    drop(state);
                    let with = (&partial.planned, &partial.watch);
                    self.complete(index, partial.outcome, with, recording);
                }
                return;
            }
            let Some(span) = partial.early.remove(&partial.added) else {
                partial.recording = Some(recording);
                return;
            };
            // Adding writes to a temporary file: not under the lock.
            drop(state);
            let add = || match (recording, span) {
                (Ok(mut recording), Ok(parts)) => parts
                    .into_iter()
                    .try_for_each(|part| recording.add(part))
                    .map_err(Failed::temporary)
                    .map(|()| recording),
                (Ok(_), Err(failed)) | (Err(failed), _) => Err(failed),
            };
            let recording = catch_unwind(AssertUnwindSafe(add)).unwrap_or_else(|_| Err(broken()));
            state = self.lock();
            if let Some(partial) = state.partial.get_mut(&index) {
                partial.recording = Some(recording);
                partial.added += 1;
            }
            drop(state);
            self.start(scope);
            state = self.lock();
        }
    }

    /// Finishes a recording whose spans are all added.
    fn complete(
        &self,
        index: usize,
        mut outcome: Outcome,
        (planned, watch): (&Planned, &Watch),
        recording: Result<Recording, Failed>,
    ) {
        let plan = &planned.plan;
        let stretch =
            reading::check_stretch(&self.inputs[index], &plan.config.signal, &mut outcome);
        let finish = || -> Result<Parts, Failed> {
            let recording = recording?;
            watch.check_content(&outcome.identity)?;
            stretch?;
            let total = recording.total();
            Ok(match recording.complete()? {
                Features::Summary(row) => (Vec::new(), Some(row), total),
                Features::Frames(arrays) => {
                    let compression = self.limits.compression;
                    let id = &self.inputs[index].id;
                    let members = Member::of(id, plan, arrays, compression);
                    (members.map_err(Failed::temporary)?, None, total)
                }
            })
        };
        match finish() {
            Ok((arrays, row, total)) => {
                if let Some(longest) = plan.longest_transform()
                    && total < longest as u64
                    && !std::mem::replace(&mut self.lock().warned, true)
                {
                    self.progress.warning(&format!(
                        "{}: {total} samples are shorter than n_fft = {longest}; said once a run",
                        outcome.id
                    ));
                }
                let row = row.map(|row| (row, plan.summary_names()));
                self.hand_over(index, Finished { outcome, arrays, row });
            }
            Err(failed) => self.fail(index, outcome, failed),
        }
    }

    /// An input without features; or the end of the run, where the fault is not the input's.
    fn fail(&self, index: usize, mut outcome: Outcome, failed: Failed) {
        if let Some(source) = failed.temporary {
            let path = self.folder.clone();
            self.lock().error.get_or_insert(RunError::Temporary { path, source });
            return;
        }
        if self.inputs[index].source == InputSource::Stdin && self.stop.load(Ordering::Relaxed) {
            // The stream did not fail: it was no longer listened to.
            return;
        }
        if failed.status == Status::Changed {
            // It is of a file that is no more: what is there now is to be read again.
            outcome.identity.clear();
        }
        outcome.status = failed.status;
        outcome.reason = failed.reason;
        outcome.byte_offset = failed.byte_offset;
        self.hand_over(index, Finished { outcome, arrays: Vec::new(), row: None });
    }

    fn hand_over(&self, index: usize, finished: Finished) {
        self.lock().ready.insert(index, finished);
    }

    /// Writes what is ready, unless another job is at it.
    fn drain<'s>(&'s self, scope: &Scope<'s>) {
        loop {
            let mut output = match self.output.try_lock() {
                Ok(output) => output,
                Err(TryLockError::WouldBlock) => return,
                Err(TryLockError::Poisoned(_)) => {
                    self.lock().error.get_or_insert(RunError::Broken);
                    return;
                }
            };
            loop {
                let index = output.next;
                let mut state = self.lock();
                if state.error.is_some() {
                    return;
                }
                let Some(finished) = state.ready.remove(&index) else { break };
                drop(state);
                match output.write(&self.inputs[index], finished) {
                    Ok(outcome) => {
                        self.written(&outcome);
                        self.start(scope);
                    }
                    Err(error) => {
                        self.lock().error.get_or_insert(error);
                        return;
                    }
                }
            }
            let next = output.next;
            drop(output);
            // Another job may have handed over the next one while we held the lock.
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
            if let Some(limit) = self.limits.max_errors
                && state.failed > limit
            {
                let (failed, last) =
                    (state.failed, format!("{}: {}", outcome.path, outcome.reason));
                state.error = Some(RunError::TooManyErrors { failed, limit, last });
            }
        }
    }
}

fn broken() -> Failed {
    Failed::new(Status::Unsupported, "a fault of this program, please report it")
}
