//! Arguments and last words of `capacity train`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use corsmal_ccm::submission::RowKey;

use super::source::Source;
use crate::args::Told;
use crate::failure::FAILED_FILES;

/// Arguments of `capacity train`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat capacity train --method fused --data ~/CCM --out fused.capacity
  corsmal-feat capacity train --method m2 --data ~/CCM --set epochs=50 --checkpoints kept \\
      --out m2.safetensors

m2 trains its network (in a build with the feature `nets`) with the published recipe: 500 epochs of
Adam on a random 85 % of the regions; the score after each epoch is that of the other 15 %, of the
same containers. A recording with damaged files is left out and named.

Exit codes: 0 all fine, 1 some recordings have damaged files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// The method.
    #[arg(long, value_enum)]
    pub(super) method: Learning,
    #[command(flatten)]
    pub(super) source: Source,
    /// A value of m2's recipe, such as epochs=50; `corsmal-feat nets m2-capacity` lists them.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(super) parameters: Vec<String>,
    /// Folder in which to save m2's training after each epoch; the next run continues from it.
    #[arg(long, value_name = "FOLDER")]
    pub(super) checkpoints: Option<PathBuf>,
    /// Model to write.
    #[arg(long, short, value_name = "FILE")]
    pub(super) out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    pub(super) overwrite: bool,
    #[command(flatten)]
    pub(super) told: Told,
}

/// Methods that learn.
#[derive(Clone, Copy, ValueEnum)]
pub(super) enum Learning {
    /// A network on the nearest large object in the third view's depth.
    M2,
    /// Gaussian processes on the sizes of detected regions.
    M3,
    /// M3's processes, and bias and spread of all methods.
    Fused,
}

/// Said of a model that learned from synthetic recordings.
pub(super) const SYNTHETIC: &str = "SYNTHETIC data: scores say nothing about real recordings";

/// Names the recordings that taught nothing; the exit code.
pub(super) fn ended(failed: &[(RowKey, String)], recordings: usize) -> ExitCode {
    if failed.is_empty() {
        return ExitCode::SUCCESS;
    }
    for (key, reason) in failed {
        eprintln!("{key}: {reason}");
    }
    eprintln!(
        "{} of {recordings} recordings have damaged files and were not used for training",
        failed.len()
    );
    ExitCode::from(FAILED_FILES)
}
