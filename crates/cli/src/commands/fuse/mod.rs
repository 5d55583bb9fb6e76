//! `corsmal-feat fuse`: one decision from several prediction files.

mod args;
mod submission;

use std::process::ExitCode;

pub use args::Args;

use crate::failure::{FAILED_FILES, Failure};
use crate::output::{self, is_stdout};
use crate::publish;

/// Fuses and writes.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let to_stdout = is_stdout(&args.out);
    if to_stdout && args.told.json {
        return Err(Failure::new("--json: --out has the predictions on standard output"));
    }
    if !to_stdout {
        publish::check_table(&args.out, args.overwrite)?;
        publish::spare(&args.out, args.tables())?;
    }
    let paths = if args.predictions.is_empty() { &args.files } else { &args.predictions };
    if paths.is_empty() {
        return submission::run(&args);
    }
    args.submission.refuse_without_submission()?;
    let fused = args.fused(paths, args.weights.as_deref())?;
    output::write(&args.out, &fused.to_csv()?)?;
    let (recordings, failed) = (fused.rows.len(), fused.without_prediction());
    args.tell(recordings, failed, &[("prediction", failed)])?;
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}
