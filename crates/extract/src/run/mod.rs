//! A run: inputs through the engine into one output, in parallel, in order, resumable.

mod check;
mod collector;
mod error;
mod frames;
mod options;
mod output;
mod partitions;
mod queue;
mod recordings;
mod stored;
mod work;

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::draft;
use corsmal_files::format::OutputFormat;
use corsmal_files::npz::Compression;
use corsmal_files::table::Table;

use crate::config::Config;
use crate::inputs::{Identities, Input};
use crate::ledger::{self, Ledger, Record, Resumed};
use crate::survey::Survey;

use collector::{Collector, Limits};
use output::Output;
use partitions::PartitionBy;

pub use check::{Checked, check};
pub use error::RunError;
pub use options::{MAX_JOBS, Progress, Quiet, RunOptions, RunReport};
pub use recordings::{Batch, InOrder, Piece, Recorded, Recordings};
pub use stored::{StoredOutput, fetch_to};

/// Extracts the features of `inputs` into one output. `stop` ends the run early, its ledger intact. An
/// output for a store is made in a file of the work folder, with ledger and partial output beside it; when
/// it is complete, it is sent and removed here.
///
/// # Errors
/// [`RunError`]; failures of single recordings are outcomes instead.
pub fn run(
    inputs: &[Input],
    config: &Arc<Config>,
    options: &RunOptions,
    progress: &dyn Progress,
    stop: &Arc<AtomicBool>,
) -> Result<RunReport, RunError> {
    let checked = check(inputs, config, options, stop)?;
    if let Some(advice) = checked.advice() {
        progress.warning(advice);
    }
    let Checked { out, format, provenance, done, stored, is_sent, .. } = checked;
    let send = |report: RunReport| match &stored {
        None => Ok(report),
        Some(stored) if is_sent => stored.forget().map(|()| report),
        Some(stored) => {
            stored.publish(options.overwrite, stop)?;
            Ok(RunReport { up_to_date: false, ..report })
        }
    };
    let all = inputs;
    let inputs = options.shard.of(all);
    let by = options.partition_by.as_deref();
    let by = by.map(|label| PartitionBy::of(label, all, inputs)).transpose()?;
    let header = match &by {
        None => ledger::Header::new(&provenance, format),
        Some(by) => ledger::Header::new(&provenance, format_args!("{format} by {}", by.label())),
    };
    if let Some(report) = done {
        // What a kill between the last two steps of that run has left.
        Ledger::forget(&out, &header)?;
        return send(report);
    }
    let (ledger, records) = if options.resume && !options.overwrite {
        resume((inputs, stop), &out, &header, progress)?
    } else {
        (Ledger::create(&out, &header)?, Vec::new())
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
    let output = Output::new(ledger, records, inputs, (format, frames))?;
    let survey = Survey::of(all, config, stop);
    survey.warnings().iter().for_each(|warning| progress.warning(warning));
    progress.start(inputs.len(), resumed);
    let RunOptions { jobs, max_errors, .. } = *options;
    // Frames on their way to Parquet wait as they are.
    let compression = match format {
        OutputFormat::Npz(compression) => compression,
        OutputFormat::Parquet => Compression::Stored,
    };
    let limits = Limits { jobs, max_errors, compression };
    let folder = draft::folder(&out).to_path_buf();
    let collector =
        Collector::new(inputs, config, limits, &survey, folder, (progress, stop), output);
    let output = collector.work()?;
    if stop.load(Ordering::Relaxed) {
        return Err(RunError::Interrupted);
    }
    let outcomes = output.publish(&provenance, by.as_ref())?.into_outcomes();
    send(RunReport { outcomes, resumed, up_to_date: false })
}

/// Extracts the statistics of `inputs` into a table in memory. `stop` ends the run early. Long
/// recordings put temporary files into `folder`.
///
/// # Errors
/// [`RunError`]; failures of single recordings are outcomes instead.
pub fn table(
    inputs: &[Input],
    config: &Arc<Config>,
    (jobs, folder): (usize, &Path),
    progress: &dyn Progress,
    stop: &Arc<AtomicBool>,
) -> Result<Table, RunError> {
    check::require_jobs(jobs)?;
    if config.summary.is_none() {
        return Err(RunError::NoSummary);
    }
    let output = Output::in_memory(inputs)?;
    let survey = Survey::of(inputs, config, stop);
    survey.warnings().iter().for_each(|warning| progress.warning(warning));
    progress.start(inputs.len(), 0);
    let limits = Limits { jobs, max_errors: None, compression: Compression::Stored };
    let folder = folder.to_path_buf();
    let collector =
        Collector::new(inputs, config, limits, &survey, folder, (progress, stop), output);
    let output = collector.work()?;
    if stop.load(Ordering::Relaxed) {
        return Err(RunError::Interrupted);
    }
    Ok(output.into_table())
}

/// What an interrupted run has done of what is still the same.
fn resume(
    (inputs, stop): (&[Input], &Arc<AtomicBool>),
    out: &Path,
    header: &ledger::Header,
    progress: &dyn Progress,
) -> Result<(Ledger, Vec<Record>), RunError> {
    // A file that has changed, repaired it may be, is read again, and so is what follows it. What
    // cannot be read just now may be the same: nothing done is given up for it.
    let unreadable = RefCell::new(None);
    let identities = Identities::of(inputs, stop);
    let keep = |i: usize, record: &Record| {
        let Some(input) = inputs.get(i).filter(|input| input.id == record.outcome.id) else {
            return false;
        };
        let now = identities.get(i);
        if stop.load(Ordering::Relaxed) {
            // What is not known to have changed stays done.
            return true;
        }
        if now.is_empty() && !record.outcome.identity.is_empty() {
            unreadable.replace(Some(input.source.to_string()));
            return true;
        }
        let same = record.outcome.identity == now;
        if !same {
            let id = &record.outcome.id;
            progress.warning(&format!("{id} has changed; the run continues from there"));
        }
        same
    };
    let (ledger, Resumed { records, dropped }) = Ledger::resume(out, header, keep)?;
    if stop.load(Ordering::Relaxed) {
        return Err(RunError::Interrupted);
    }
    if let Some(path) = unreadable.into_inner() {
        return Err(RunError::Unreadable { path });
    }
    if let Some(reason) = dropped {
        progress.warning(&format!("{reason}; the run continues from there"));
    }
    Ok((ledger, records))
}
