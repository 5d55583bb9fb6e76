//! A run whose output is open: what it has done before, and how it is completed.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::draft;
use corsmal_files::format::OutputFormat;
use corsmal_files::identity;
use corsmal_files::npz::Compression;
use corsmal_files::provenance::Provenance;

use super::check::{Checked, check};
use super::error::RunError;
use super::options::{Progress, RunOptions, RunReport};
use super::output::Output;
use super::partitions::PartitionBy;
use super::stored::StoredOutput;
use crate::config::Config;
use crate::inputs::{Identities, Input};
use crate::ledger::{self, Ledger, LedgerError, Record, Resumed};
use crate::survey::Survey;

/// A run that has begun, or was done before.
pub struct Begun<'a>(State<'a>);

enum State<'a> {
    Done(RunReport),
    Open(Box<Open<'a>>),
}

/// A run whose output is open.
pub(super) struct Open<'a> {
    /// Those of its shard.
    pub inputs: &'a [Input],
    pub config: &'a Arc<Config>,
    pub survey: Survey,
    pub output: Output,
    pub ending: Ending<'a>,
}

/// What completes an output.
pub(super) struct Ending<'a> {
    out: PathBuf,
    provenance: Provenance,
    by: Option<PartitionBy<'a>>,
    format: OutputFormat,
    stored: Option<StoredOutput>,
    overwrite: bool,
    /// Inputs of an interrupted run.
    pub resumed: usize,
    /// Failed files after which to stop.
    pub max_errors: Option<usize>,
}

impl<'a> Begun<'a> {
    /// Opens the output of a run of `inputs`.
    ///
    /// # Errors
    /// [`RunError`], in what concerns the output, an interrupted run and the inputs as a whole.
    pub fn new(
        inputs: &'a [Input],
        config: &'a Arc<Config>,
        options: &'a RunOptions,
        progress: &dyn Progress,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, RunError> {
        let checked = check(inputs, config, options, stop)?;
        if let Some(advice) = checked.advice() {
            progress.warning(advice);
        }
        let Checked { out, format, provenance, done, stored, is_sent, .. } = checked;
        let all = inputs;
        let inputs = options.shard.of(all);
        let by = options.partition_by.as_deref();
        let by = by.map(|label| PartitionBy::of(label, all, inputs)).transpose()?;
        let header = match &by {
            None => ledger::Header::new(&provenance, format),
            Some(by) => {
                ledger::Header::new(&provenance, format_args!("{format} by {}", by.label()))
            }
        };
        let RunOptions { overwrite, max_errors, .. } = *options;
        let ending = |resumed| Ending {
            out: out.clone(),
            provenance: provenance.clone(),
            by,
            format,
            stored: stored.clone(),
            overwrite,
            resumed,
            max_errors,
        };
        if let Some(report) = done {
            // What a kill between the last two steps of that run has left.
            Ledger::forget(&out, &header)?;
            if is_sent {
                stored.iter().try_for_each(StoredOutput::forget)?;
                return Ok(Self(State::Done(report)));
            }
            return ending(report.resumed).send(report, stop).map(State::Done).map(Self);
        }
        // Before headers are read, which may take long.
        Ledger::require_idle(&out)?;
        let survey = Survey::of(all, config, stop);
        let resumed = match options.resume {
            true => resume((inputs, all), (&survey, stop), &out, &header, progress).map(Some),
            false => Ok(None),
        };
        let resumed = match resumed {
            Err(RunError::Ledger(LedgerError::Differs { path, field, found, expected }))
                if overwrite =>
            {
                let path = path.display();
                progress.warning(&format!(
                    "{path} is of a run with {field} {found}, this one has {expected}: the run starts again"
                ));
                None
            }
            resumed => resumed?,
        };
        let (ledger, records) = match resumed {
            Some(resumed) => resumed,
            None => (Ledger::create(&out, &header)?, Vec::new()),
        };
        if let Some(limit) = options.max_errors {
            let bad: Vec<_> =
                records.iter().map(|r| &r.outcome).filter(|o| !o.status.has_features()).collect();
            if let Some(last) = bad.last().filter(|_| bad.len() > limit) {
                let last = format!("{}: {}", last.path, last.reason);
                return Err(RunError::TooManyErrors { failed: bad.len(), limit, last });
            }
        }
        let resumed = records.len();
        let frames = config.summary.is_none();
        let output = Output::new(ledger, records, (inputs, all), (format, frames))?;
        survey.warnings().iter().for_each(|warning| progress.warning(warning));
        let ending = ending(resumed);
        Ok(Self(State::Open(Box::new(Open { inputs, config, survey, output, ending }))))
    }

    /// The open run, or the report of what was done before.
    pub(super) fn open(self) -> Result<Open<'a>, RunReport> {
        match self.0 {
            State::Done(report) => Err(report),
            State::Open(open) => Ok(*open),
        }
    }
}

impl Ending<'_> {
    /// Folder of temporary files: that of the output.
    pub fn folder(&self) -> PathBuf {
        draft::folder(&self.out).to_path_buf()
    }

    /// How arrays wait for the end: frames on their way to Parquet as they are.
    pub fn compression(&self) -> Compression {
        match self.format {
            OutputFormat::Npz(compression) => compression,
            OutputFormat::Parquet => Compression::Stored,
        }
    }

    /// Completes the output, unless the run was stopped.
    pub fn publish(self, output: Output, stop: &Arc<AtomicBool>) -> Result<RunReport, RunError> {
        if stop.load(Ordering::Relaxed) {
            return Err(RunError::Interrupted);
        }
        let outcomes = output.publish(&self.provenance, self.by.as_ref())?.into_outcomes();
        let report = RunReport { outcomes, resumed: self.resumed, up_to_date: false };
        self.send(report, stop)
    }

    /// Sends a complete output to its store, if it has one.
    fn send(&self, report: RunReport, stop: &Arc<AtomicBool>) -> Result<RunReport, RunError> {
        let Some(stored) = &self.stored else { return Ok(report) };
        stored.publish(self.overwrite, stop)?;
        Ok(RunReport { up_to_date: false, ..report })
    }
}

/// What an interrupted run has done of what is still the same.
fn resume(
    (inputs, all): (&[Input], &[Input]),
    (survey, stop): (&Survey, &Arc<AtomicBool>),
    out: &Path,
    header: &ledger::Header,
    progress: &dyn Progress,
) -> Result<(Ledger, Vec<Record>), RunError> {
    // A file that has changed, repaired it may be, is read again, and so is what follows it. What
    // cannot be read just now may be the same: nothing done is given up for it.
    let (unreadable, unversioned) = (RefCell::new(None), Cell::new(false));
    let identities = Identities::of(inputs, stop);
    let keep = |i: usize, record: &Record| {
        let Some(input) = inputs.get(i).filter(|input| input.id == record.outcome.id) else {
            return false;
        };
        if unreadable.borrow().is_some() {
            return true;
        }
        let now = identities.get(i);
        if stop.load(Ordering::Relaxed) {
            // What is not known to have changed stays done.
            return true;
        }
        if now.is_empty() && !record.outcome.identity.is_empty() {
            unreadable.replace(Some(input.source.to_string()));
            return true;
        }
        let id = &record.outcome.id;
        if input.source.comes_once() {
            progress.warning(&format!(
                "{id} came from a stream, so it is read again; the run continues from there"
            ));
            return false;
        }
        let same = record.outcome.identity == now;
        if !same {
            progress.warning(&format!("{id} has changed; the run continues from there"));
        } else if !survey.agrees(&record.outcome) {
            // Most recordings of those that can be read now may not be most recordings.
            let of_all = Identities::of(all, stop);
            if let Some(hidden) = (0..all.len()).find(|i| of_all.get(*i).is_empty()) {
                unreadable.replace(Some(all[hidden].source.to_string()));
                return true;
            }
            progress.warning(&format!(
                "most recordings now have another number of channels: {id} and what follows it are computed again"
            ));
            return false;
        } else if now == identity::STREAM && !unversioned.replace(true) {
            progress.warning(&format!(
                "{id}: its server sends neither ETag nor Last-Modified, so it may have changed unnoticed; its features \
                 are kept (reported once per run)"
            ));
        }
        same
    };
    let (ledger, Resumed { mut records, dropped }) = Ledger::resume(out, header, keep)?;
    if stop.load(Ordering::Relaxed) {
        return Err(RunError::Interrupted);
    }
    if let Some(path) = unreadable.into_inner() {
        return Err(RunError::Unreadable { path });
    }
    if let Some(reason) = dropped {
        progress.warning(&format!("{reason}; the run continues from there"));
    }
    records.iter_mut().for_each(|record: &mut Record| survey.renew(&mut record.outcome));
    Ok((ledger, records))
}
