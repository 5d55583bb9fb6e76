//! `corsmal-feat fuse`: one decision from several prediction files.

mod args;
mod submission;

use std::process::ExitCode;

use corsmal_files::draft;

pub use args::Args;

use crate::failure::{FAILED_FILES, Failure};
use crate::publish;

/// Fuses and writes.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let to_stdout = args.out.as_os_str() == "-";
    if !to_stdout {
        publish::check(&args.out, args.overwrite)?;
    }
    let paths = if args.predictions.is_empty() { &args.files } else { &args.predictions };
    if paths.is_empty() {
        return submission::run(&args);
    }
    args.submission.refuse_without_submission()?;
    let fused = args.fused(paths, args.weights.as_deref())?;
    let bytes = fused.to_csv()?;
    if to_stdout {
        print!("{}", String::from_utf8_lossy(&bytes));
    } else {
        draft::write(&args.out, &bytes)?;
    }
    let failed = fused.without_prediction();
    if !args.quiet {
        eprintln!("{} recordings, {failed} without a prediction", fused.rows.len());
    }
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}
