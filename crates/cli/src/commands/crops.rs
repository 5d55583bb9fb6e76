//! `corsmal-feat crops`: cropped pictures of containers, for the networks of the vision baseline.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_ccm::CcmError;
use corsmal_ccm::capacity::doubtful_colours;
use corsmal_ccm::crop::{self, Written};
use serde_json::json;

use crate::args::{Jobs, Told};
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::plural::plural;

/// Arguments of `crops`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat crops --data ~/CCM --out crops
  corsmal-feat train --net resnet18-level --crops crops -o level.safetensors
  corsmal-feat cross-validate --net resnet18-type --crops crops --weights resnet18.pth

Writes a picture for each view of a labelled training recording whose last colour frame shows a cup
or wine glass, and labels.csv with the columns id, container, view, level and type. Level and type
are \"opaque\" if the container hides what it holds. docs/vision.md lists the files that the command
reads. Labels are written last; an interrupted run leaves nothing behind.

Exit codes: 0 all fine, 1 some recordings have damaged files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// Folder of the data set.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder of tables of detections (SEQUENCE.csv or .json, by container or not); by default
    /// `detections/` next to each recording's audio folder.
    #[arg(long, value_name = "DIR")]
    detections: Option<PathBuf>,
    /// Folder to write to: new or empty.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    jobs: Jobs,
    #[command(flatten)]
    told: Told,
}

/// Writes the pictures.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Args { data, detections, out, jobs, told } = args;
    crate::publish::require_disk(&out)?;
    let stop = crate::interrupt::flag();
    if let Some(doubt) = doubtful_colours(&crate::commands::dataset::open(&data)?.recordings) {
        eprintln!("warning: {doubt}");
    }
    let written = match crop::write(&data, detections.as_deref(), &out, jobs.count(), stop) {
        Err(error @ CcmError::Interrupted) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        written => written?,
    };
    let Written { crops, recordings, without, failed, synthetic } = written;
    let failures = failed.len();
    told.tell(
        || {
            json!({
                "out": out.display().to_string(), "crops": crops, "recordings": recordings, "views_without": without,
                "failed": failures, "synthetic": synthetic,
            })
        },
        || {
            format!(
                "{}: {} of {}, {} show no container",
                out.display(),
                plural(crops, "picture"),
                plural(recordings, "recording"),
                plural(without, "view")
            )
        },
    )?;
    if failed.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    for (key, reason) in &failed {
        eprintln!("{key}: {reason}");
    }
    eprintln!("{failures} of {recordings} recordings have damaged files and are left out");
    Ok(ExitCode::from(FAILED_FILES))
}
