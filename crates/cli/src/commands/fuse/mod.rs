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
    if to_stdout && args.told.json {
        return Err(Failure::new("--json: --out - has the predictions on standard output"));
    }
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
    let (recordings, failed) = (fused.rows.len(), fused.without_prediction());
    args.tell(recordings, failed, "a prediction")?;
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}
