//! A run: inputs through the engine into one output, in parallel, in order, resumable.

mod begun;
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
mod together;
mod work;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::npz::Compression;
use corsmal_files::table::Table;

use crate::config::Config;
use crate::inputs::Input;
use crate::survey::Survey;

use begun::Open;
use collector::{Collector, Limits};
use output::Output;

pub use begun::Begun;
pub use check::{Checked, check};
pub use error::RunError;
pub(crate) use options::mixed;
pub use options::{MAX_JOBS, Progress, Quiet, RunOptions, RunReport};
pub use recordings::{Batch, InOrder, Piece, Recorded, Recordings};
pub use stored::{StoredOutput, fetch_to};
pub use together::together;

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
    let open = match Begun::new(inputs, config, options, progress, stop)?.open() {
        Ok(open) => open,
        Err(report) => return Ok(report),
    };
    let Open { inputs, survey, output, ending, .. } = open;
    progress.start(inputs.len(), ending.resumed);
    let (jobs, max_errors) = (options.jobs, options.max_errors);
    let limits = Limits { jobs, max_errors, compression: ending.compression() };
    let (folder, told) = (ending.folder(), (progress, stop));
    let collector = Collector::new(inputs, config, limits, &survey, folder, told, output);
    let report = ending.publish(collector.work()?, stop)?;
    mixed(&report.outcomes).iter().for_each(|warning| progress.warning(warning));
    Ok(report)
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
    mixed(output.outcomes()).iter().for_each(|warning| progress.warning(warning));
    Ok(output.into_table())
}
