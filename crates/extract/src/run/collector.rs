//! The order of work, and the order in which results reach the output.
//!
//! A job computes one span of a recording that was cut, or else the next input. Whoever completes a
//! recording finishes it and hands it over; results are written in the order of the inputs by
//! whichever job finds the next one ready. Each job starts those that can go on after it, so nobody
//! waits: threads without a job lend a hand to the jobs that split their work, or sleep. Inputs are
//! taken only a few ahead of the one being written, so memory stays bounded.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

use corsmal_files::npz::Compression;
use corsmal_files::outcome::Outcome;
use rayon::Scope;

use super::error::RunError;
use super::options::Progress;
use super::output::{Finished, Output};
use super::queue::{Partial, Queue, Work};
use super::work::{self, Parts, SpanJob, broken, outcome_of};
use crate::config::Config;
use crate::engine::{Decoders, Failed, Planned, Plans, Recording, Watch, reading};
use crate::inputs::Input;
use crate::survey::Survey;

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
    decoders: Decoders,
    /// Folder of temporary files: that of the output.
    folder: PathBuf,
    queue: Mutex<Queue>,
    output: Mutex<Output>,
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
        let queue = Queue::new(inputs.len(), output.next, failed);
        Self {
            inputs,
            limits,
            survey,
            progress,
            stop,
            plans: Plans::new(config.clone(), |warning| progress.warning(warning)),
            decoders: Decoders::default(),
            folder,
            queue: Mutex::new(queue),
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
        let queue = self.queue.into_inner().unwrap_or_else(|e| e.into_inner());
        match queue.error {
            Some(error) => Err(error),
            None => Ok(self.output.into_inner().unwrap_or_else(|e| e.into_inner())),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Starts as many jobs as can be at work now.
    fn start<'s>(&'s self, scope: &Scope<'s>) {
        let mut queue = self.lock();
        while let Some(work) = self.next(&mut queue) {
            queue.running += 1;
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
        let mut queue = self.lock();
        if let (Some(span), Some(partial)) = (span, queue.partial.get_mut(&input)) {
            partial.early.insert(span, Err(failed));
            drop(queue);
            return self.join(input, scope);
        }
        drop(queue);
        let source = &self.inputs[input];
        self.fail(input, outcome_of(source), failed);
    }

    /// The next thing to do; none while enough are at work or too much is unwritten.
    fn next(&self, queue: &mut Queue) -> Option<Work> {
        if self.stop.load(Ordering::Relaxed) { None } else { queue.next(self.limits.jobs) }
    }

    /// Opens an input; computes it, or cuts it and computes its first span.
    fn input(&self, index: usize) {
        let input = &self.inputs[index];
        let watch = Watch::begin(input);
        let mut outcome = outcome_of(input);
        let (with, by) = ((&watch, Some(&self.decoders)), (&self.plans, self.survey));
        let opened = match work::open(input, with, by, self.stop, &mut outcome) {
            Ok(opened) => opened,
            Err(failed) => return self.fail(index, outcome, failed),
        };
        let planned = opened.planned.clone();
        if opened.spans.len() == 1 {
            let with = (&watch, &self.decoders);
            return match work::whole(opened, with, &self.folder, self.stop, &mut outcome) {
                Ok(None) => {}
                Ok(Some(recording)) => {
                    self.complete(index, outcome, (&planned, &watch), Ok(recording));
                }
                Err(failed) => self.fail(index, outcome, failed),
            };
        }
        let recording = Recording::new(planned.plan.clone(), &self.folder);
        let spans = opened.spans;
        let partial = Partial {
            outcome,
            planned: planned.clone(),
            watch: watch.clone(),
            spans: spans.len(),
            added: 0,
            early: BTreeMap::new(),
            recording: Some(Ok(recording)),
        };
        let mut queue = self.lock();
        queue.partial.insert(index, partial);
        queue.spans.extend(spans.into_iter().enumerate().map(|(i, span)| SpanJob {
            input: index,
            index: i,
            span,
            planned: planned.clone(),
            watch: watch.clone(),
        }));
    }

    /// Computes one span of a recording that was cut.
    fn span<'s>(&'s self, job: SpanJob, scope: &Scope<'s>) {
        let Some(done) = job.compute(&self.inputs[job.input], self.stop) else { return };
        let mut queue = self.lock();
        if let Some(partial) = queue.partial.get_mut(&job.input) {
            if let Some((source, crop)) = done.source {
                reading::describe(&mut partial.outcome, source.as_ref(), &crop);
            }
            partial.outcome.decoded_frames += done.decoded;
            partial.early.insert(job.index, done.parts);
        }
        drop(queue);
        self.join(job.input, scope);
    }

    /// Adds the spans whose turn it is to their recording, unless another job is at it.
    fn join<'s>(&'s self, index: usize, scope: &Scope<'s>) {
        let mut queue = self.lock();
        loop {
            let Some(partial) = queue.partial.get_mut(&index) else { return };
            let Some(recording) = partial.recording.take() else { return };
            if partial.added == partial.spans {
                if let Some(partial) = queue.partial.remove(&index) {
                    drop(queue);
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
            drop(queue);
            let add = || match (recording, span) {
                (Ok(mut recording), Ok(parts)) => parts
                    .into_iter()
                    .try_for_each(|part| recording.add(part))
                    .map_err(Failed::temporary)
                    .map(|()| recording),
                (Ok(_), Err(failed)) | (Err(failed), _) => Err(failed),
            };
            let recording = catch_unwind(AssertUnwindSafe(add)).unwrap_or_else(|_| Err(broken()));
            queue = self.lock();
            if let Some(partial) = queue.partial.get_mut(&index) {
                partial.recording = Some(recording);
                partial.added += 1;
            }
            drop(queue);
            self.start(scope);
            queue = self.lock();
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
        let (input, compression) = (&self.inputs[index], self.limits.compression);
        let plan = &planned.plan;
        match work::finish(input, (planned, watch), recording, compression, &mut outcome) {
            Ok(Parts { arrays, row, total }) => {
                if let Some(warning) = work::short(plan, total, &outcome)
                    && !std::mem::replace(&mut self.lock().warned, true)
                {
                    self.progress.warning(&warning);
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
        let source = &self.inputs[index].source;
        if source.waits() && self.stop.load(Ordering::Relaxed) {
            // The stream or store did not fail: it was no longer listened to.
            return;
        }
        work::note(&mut outcome, failed);
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
                let mut queue = self.lock();
                if queue.error.is_some() {
                    return;
                }
                let Some(finished) = queue.ready.remove(&index) else { break };
                drop(queue);
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
        let mut queue = self.lock();
        queue.written += 1;
        if !outcome.status.has_features() {
            queue.failed += 1;
            if let Some(limit) = self.limits.max_errors
                && queue.failed > limit
            {
                let (failed, last) =
                    (queue.failed, format!("{}: {}", outcome.path, outcome.reason));
                queue.error = Some(RunError::TooManyErrors { failed, limit, last });
            }
        }
    }
}
