//! A run: inputs through the engine into one output, in parallel, in order, resumable.

mod collector;
mod output;
mod plans;
mod reader;
mod signal;
mod stdin;
mod windows;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use thiserror::Error;

use crate::config::Config;
use crate::inputs::{Input, InputSource, list_hash};
use crate::ledger::{self, Ledger, LedgerError};
use corsmal_files::draft;
use corsmal_files::feature_file::{FeatureFileError, FeatureTable};
use corsmal_files::format::{FormatError, OutputFormat};
use corsmal_files::identity;
use corsmal_files::npz::{Compression, NpzError};
use corsmal_files::outcome::Outcome;
use corsmal_files::parquet::ParquetTableError;
use corsmal_files::provenance::Provenance;
use corsmal_files::shard::Shard;
use corsmal_files::table::TableError;

use collector::Collector;
use output::Output;

pub use signal::{Signal, SignalError, Signals};
pub use windows::{Window, Windowing, Windows};

/// Why a run could not start or go on. Bad recordings are not among these: they are outcomes.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RunError {
    /// The output is there and holds something else.
    #[error("{path} exists and {why}; --overwrite replaces it")]
    Exists {
        /// The output.
        path: PathBuf,
        /// What it is.
        why: String,
    },
    /// An interrupted run is there.
    #[error(
        "{path} was left by an interrupted run; --resume continues it, --overwrite starts anew"
    )]
    Pending {
        /// Its ledger.
        path: PathBuf,
    },
    /// An input of the interrupted run cannot be read any more.
    #[error("{path} cannot be read, which the interrupted run could; --resume once it can")]
    Unreadable {
        /// The input.
        path: String,
    },
    /// The output cannot take what the configuration gives.
    #[error("{path}: {why}")]
    Format {
        /// The output.
        path: PathBuf,
        /// Why, and what is allowed.
        why: String,
    },
    /// More failures than allowed.
    #[error("stopped after {failed} failed files ({limit} allowed), the last: {last}")]
    TooManyErrors {
        /// Failed files.
        failed: usize,
        /// Allowed.
        limit: usize,
        /// Path and reason of the last.
        last: String,
    },
    /// The user stopped the run; `--resume` continues it.
    #[error("interrupted; --resume continues the run")]
    Interrupted,
    /// The output failed.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The ledger failed.
    #[error(transparent)]
    Ledger(#[from] LedgerError),
    /// The table failed.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The Parquet output failed.
    #[error(transparent)]
    Parquet(#[from] ParquetTableError),
    /// The output has a name that none can have.
    #[error(transparent)]
    Name(#[from] FormatError),
    /// A fault of this program while writing the output.
    #[error("a fault of this program, please report it; --resume continues the run")]
    Broken,
    /// A temporary file beside the output failed.
    #[error("{path}: temporary file: {source}")]
    Temporary {
        /// Its folder.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// So many workers are not possible.
    #[error("jobs = {jobs} is not possible: {why}")]
    Jobs {
        /// Number asked for.
        jobs: usize,
        /// What is possible, or what the system says.
        why: String,
    },
}

/// Most worker threads.
pub const MAX_JOBS: usize = 1024;

/// How to run.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// The output, `.npz` or `.parquet`.
    pub out: PathBuf,
    /// Compression of `.npz` members.
    pub compression: Compression,
    /// Worker threads, 1 to [`MAX_JOBS`].
    pub jobs: usize,
    /// Part of the inputs.
    pub shard: Shard,
    /// Continue an interrupted run.
    pub resume: bool,
    /// Replace an existing output and forget an interrupted run.
    pub overwrite: bool,
    /// Failed files after which to stop; `None` never stops.
    pub max_errors: Option<usize>,
}

/// What happened to the inputs.
#[derive(Debug, Clone, Default)]
pub struct RunReport {
    /// One row per input, in order.
    pub outcomes: Vec<Outcome>,
    /// Inputs taken over from an interrupted run.
    pub resumed: usize,
    /// The output was complete already.
    pub up_to_date: bool,
}

impl RunReport {
    /// Inputs without features.
    pub fn failed(&self) -> usize {
        self.outcomes.iter().filter(|o| !o.status.has_features()).count()
    }
}

/// Told what goes on, from several threads.
pub trait Progress: Sync {
    /// The run begins: inputs in all, and those already done.
    fn start(&self, inputs: usize, done: usize);
    /// An input is written.
    fn done(&self, outcome: &Outcome);
    /// Something the user should know, once per run.
    fn warning(&self, message: &str);
}

/// Tells nobody.
pub struct Quiet;

impl Progress for Quiet {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, _: &Outcome) {}
    fn warning(&self, _: &str) {}
}

/// Extracts the features of `inputs` into one output. `stop` ends the run early, its ledger intact.
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
    let Checked { format, provenance, done } = check(inputs, config, options)?;
    let inputs = options.shard.of(inputs);
    let header = ledger::Header::new(&provenance, format);
    if let Some(report) = done {
        // What a kill between the last two steps of that run has left.
        Ledger::forget(&options.out, &header)?;
        return Ok(report);
    }
    let (ledger, records) = if options.resume && !options.overwrite {
        // A file that has changed, repaired it may be, is read again, and so is what follows it.
        // What cannot be read just now may be the same: nothing done is given up for it.
        let unreadable = RefCell::new(None);
        let hold = |i: usize, record: &ledger::Record| {
            let Some(input) = inputs.get(i) else { return false };
            let now = identity_of(input);
            if now.is_empty() && !record.outcome.identity.is_empty() {
                unreadable.replace(Some(input.source.to_string()));
                return true;
            }
            let same = record.outcome.identity == now;
            if !same {
                let id = &record.outcome.id;
                progress.warning(&format!("{id} has changed; the run goes on from there"));
            }
            same
        };
        let resumed = Ledger::resume(&options.out, &header, hold)?;
        if let Some(path) = unreadable.into_inner() {
            return Err(RunError::Unreadable { path });
        }
        resumed
    } else {
        (Ledger::create(&options.out, &header)?, Vec::new())
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
    let output = Output::new(ledger, records, inputs, format)?;
    progress.start(inputs.len(), resumed);
    let collector = Collector::new(inputs, config, options, progress, stop, output);
    let output = collector.work()?;
    if stop.load(Ordering::Relaxed) {
        return Err(RunError::Interrupted);
    }
    let outcomes = output.publish(&provenance)?;
    Ok(RunReport { outcomes, resumed, up_to_date: false })
}

/// What is known of a run before it starts.
pub struct Checked {
    format: OutputFormat,
    provenance: Provenance,
    /// The report of an output that is there already.
    done: Option<RunReport>,
}

/// Everything that a run refuses before it starts.
///
/// # Errors
/// As [`run`], in what concerns the output, the inputs as a whole and the number of jobs.
pub fn check(inputs: &[Input], config: &Config, options: &RunOptions) -> Result<Checked, RunError> {
    let out = &options.out;
    let format = check_output(options, config)?;
    if !(1..=MAX_JOBS).contains(&options.jobs) {
        return Err(RunError::Jobs { jobs: options.jobs, why: format!("1 to {MAX_JOBS}") });
    }
    let is_out = |i: &&Input| match &i.source {
        InputSource::File(path) => path.file_name() == out.file_name() && draft::same(path, out),
        InputSource::Stdin => false,
    };
    if let Some(input) = inputs.iter().find(is_out) {
        let why = format!("is the input {} itself", input.id);
        return Err(RunError::Format { path: out.clone(), why });
    }
    let (text, hash) = (config.to_value().to_string(), config.hash());
    let provenance = Provenance::new(text, hash, list_hash(inputs), options.shard);
    let mut done = None;
    if !options.overwrite {
        done = finished(options.shard.of(inputs), &provenance, out, format)?;
        if done.is_none() && !options.resume && Ledger::is_pending(out) {
            Ledger::require_idle(out)?;
            return Err(RunError::Pending { path: ledger::ledger_path(out) });
        }
    }
    Ok(Checked { format, provenance, done })
}

/// The format of the output, if it can be written.
fn check_output(options: &RunOptions, config: &Config) -> Result<OutputFormat, RunError> {
    let out = options.out.as_path();
    let refuse = |why: String| Err(RunError::Format { path: out.into(), why });
    let format = OutputFormat::of_name(out, options.compression)?;
    if format == OutputFormat::Parquet && config.summary.is_none() {
        let why = "Parquet holds summary tables: the configuration needs a [summary], \
                   or write .npz";
        return refuse(why.into());
    }
    if out.is_dir() {
        return refuse("is a folder".into());
    }
    if out.exists() && !out.is_file() {
        return refuse("is no regular file".into());
    }
    let folder = draft::folder(out);
    if !folder.is_dir() {
        return refuse(format!("there is no folder {}", folder.display()));
    }
    Ok(format)
}

/// The report of an output that is already complete; an error where it holds something else.
fn finished(
    inputs: &[Input],
    provenance: &Provenance,
    out: &Path,
    format: OutputFormat,
) -> Result<Option<RunReport>, RunError> {
    if !out.exists() {
        return Ok(None);
    }
    let refuse = |why: &str| RunError::Exists { path: out.to_path_buf(), why: why.into() };
    let FeatureTable { table, provenance: theirs, format: found, .. } = FeatureTable::open(out)
        .map_err(|error| match error {
            FeatureFileError::Io { source, .. } => refuse(&format!("cannot be read: {source}")),
            _ => refuse("is not an output of this tool"),
        })?;
    if found != format {
        return Err(refuse(&format!("is {found}, not {format}")));
    }
    if theirs != *provenance {
        let why = if theirs.config_hash != provenance.config_hash {
            "holds features of another configuration"
        } else if theirs.inputs_hash != provenance.inputs_hash {
            "holds features of other inputs"
        } else if theirs.shard != provenance.shard {
            "holds another shard"
        } else {
            "was written by another version of this tool"
        };
        return Err(refuse(why));
    }
    let outcomes = table.outcomes().to_vec();
    if outcomes.iter().any(|outcome| outcome.identity == identity::STREAM) {
        return Err(refuse("holds features of a stream, which cannot be read again to compare"));
    }
    let same = outcomes.len() == inputs.len()
        && outcomes.iter().zip(inputs).all(|(o, i)| o.identity == identity_of(i));
    if !same {
        return Err(refuse("holds features of files that have changed since"));
    }
    Ok(Some(RunReport { resumed: outcomes.len(), outcomes, up_to_date: true }))
}

/// Identity of an input as it is now; empty where it cannot be read.
fn identity_of(input: &Input) -> String {
    match &input.source {
        InputSource::Stdin => identity::STREAM.to_string(),
        InputSource::File(path) => identity::of_file(path).unwrap_or_default(),
    }
}
