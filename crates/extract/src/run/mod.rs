//! A run: inputs through the engine into one output, in parallel, in order, resumable.

mod collector;
mod plans;
mod reader;
mod signal;
mod sink;
mod stdin;
mod windows;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use thiserror::Error;

use crate::config::Config;
use crate::draft;
use crate::identity;
use crate::inputs::{Input, InputSource, Shard, list_hash};
use crate::layout::{self, LayoutError};
use crate::ledger::{self, Ledger, LedgerError};
use crate::npz::{Compression, NpzError, NpzFile};
use crate::outcome::Outcome;
use crate::parquet::{self, ParquetTableError};
use crate::provenance::Provenance;
use crate::table::TableError;

use collector::Collector;
use sink::Sink;

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
    /// An input of the interrupted run has changed.
    #[error("{id} has changed since the interrupted run; --overwrite starts anew")]
    Changed {
        /// The input.
        id: String,
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
    /// The existing output cannot be read.
    #[error(transparent)]
    Layout(#[from] LayoutError),
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
pub struct Options {
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
pub struct Report {
    /// One row per input, in order.
    pub outcomes: Vec<Outcome>,
    /// Inputs taken over from an interrupted run.
    pub resumed: usize,
    /// The output was complete already.
    pub up_to_date: bool,
}

impl Report {
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
    options: &Options,
    progress: &dyn Progress,
    stop: &Arc<AtomicBool>,
) -> Result<Report, RunError> {
    let parquet = check_output(&options.out, config)?;
    if !(1..=MAX_JOBS).contains(&options.jobs) {
        return Err(RunError::Jobs { jobs: options.jobs, why: format!("1 to {MAX_JOBS}") });
    }
    let provenance = Provenance::new(
        config.to_value().to_string(),
        config.hash(),
        list_hash(inputs),
        options.shard,
    );
    let inputs = options.shard.of(inputs);
    if !options.overwrite {
        if let Some(report) = finished(inputs, &provenance, &options.out, parquet)? {
            return Ok(report);
        }
        if !options.resume && Ledger::is_pending(&options.out) {
            Ledger::require_idle(&options.out)?;
            return Err(RunError::Pending { path: ledger::ledger_path(&options.out) });
        }
    }
    let format = match (parquet, options.compression) {
        (true, _) => "parquet",
        (false, Compression::Stored) => "npz stored",
        (false, Compression::Deflated) => "npz deflated",
    };
    let header = ledger::Header::new(&provenance, format);
    let (ledger, records) = if options.resume && !options.overwrite {
        Ledger::resume(&options.out, &header)?
    } else {
        (Ledger::create(&options.out, &header)?, Vec::new())
    };
    for (record, input) in records.iter().zip(inputs) {
        if record.outcome.identity != identity_of(input) {
            return Err(RunError::Changed { id: input.id.clone() });
        }
    }
    let resumed = records.len();
    let sink = Sink::new(ledger, records, inputs, options, parquet)?;
    progress.start(inputs.len(), resumed);
    let collector = Collector::new(inputs, config, options, progress, stop, sink);
    let sink = collector.work()?;
    if stop.load(Ordering::Relaxed) {
        return Err(RunError::Interrupted);
    }
    let outcomes = sink.publish(&provenance)?;
    Ok(Report { outcomes, resumed, up_to_date: false })
}

/// Whether an output is Parquet, else `.npz`, by its extension.
///
/// # Errors
/// [`RunError::Format`]: another extension, a format that cannot hold what `config` gives, a folder
/// of that name, or no folder to put it in.
pub fn check_output(out: &Path, config: &Config) -> Result<bool, RunError> {
    let refuse = |why: String| Err(RunError::Format { path: out.into(), why });
    let parquet = match out.extension() {
        Some(e) if e.eq_ignore_ascii_case("npz") => false,
        Some(e) if e.eq_ignore_ascii_case("parquet") => true,
        _ => return refuse("must end in .npz or .parquet".into()),
    };
    if parquet && config.summary.is_none() {
        let why = "Parquet holds summary tables: the configuration needs a [summary], \
                   or write .npz";
        return refuse(why.into());
    }
    if out.is_dir() {
        return refuse("is a folder".into());
    }
    let folder = draft::folder(out);
    if !folder.is_dir() {
        return refuse(format!("there is no folder {}", folder.display()));
    }
    Ok(parquet)
}

/// The report of an output that is already complete; an error where it holds something else.
fn finished(
    inputs: &[Input],
    provenance: &Provenance,
    out: &Path,
    parquet: bool,
) -> Result<Option<Report>, RunError> {
    if !out.exists() {
        return Ok(None);
    }
    let refuse = |why: &str| RunError::Exists { path: out.to_path_buf(), why: why.into() };
    let found = if parquet {
        parquet::read(out).map_err(|_| refuse("is not an output of this tool"))?
    } else {
        let mut npz = NpzFile::open(out).map_err(|_| refuse("is not an output of this tool"))?;
        layout::read_table(&mut npz).map_err(|_| refuse("is not an output of this tool"))?
    };
    let (table, theirs) = found;
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
    // What a kill between the last two steps of that run has left.
    Ledger::forget(out)?;
    Ok(Some(Report { resumed: outcomes.len(), outcomes, up_to_date: true }))
}

/// Identity of an input as it is now; empty where it cannot be read.
fn identity_of(input: &Input) -> String {
    match &input.source {
        InputSource::Stdin => identity::STREAM.to_string(),
        InputSource::File(path) => identity::of_file(path).unwrap_or_default(),
    }
}
