//! `corsmal-feat capacity combine`: one estimate from those of several frames.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_ccm::capacity::combine_files;
use corsmal_vision::lode::PRIOR_ML;
use serde_json::json;

use crate::args::Told;
use crate::failure::Failure;
use crate::publish;

/// Arguments of `capacity combine`.
#[derive(clap::Args)]
#[command(after_help = "\
Example, M5's combination of its two frames:
  corsmal-feat capacity combine --in capacity_estimation_1_public_test.csv \\
      capacity_estimation_20_public_test.csv --out combined.csv

The estimate of a recording is the mean of its estimates in the files, or the prior if no
file has one. An estimate equal to the prior, or to the published one of 734.94 mL, counts as none,
as in the published program; so does a row with the status prior. The table written has the columns
fileName, capacity[mL], status (ok, prior, none), method (those of the files) and, for ids of the flat
release, part.")]
pub struct Args {
    /// Tables with the columns fileName and `capacity[mL]`.
    #[arg(long = "in", value_name = "CSV", num_args = 1.., required = true)]
    inputs: Vec<PathBuf>,
    /// Table to write.
    #[arg(long, short, value_name = "CSV")]
    out: PathBuf,
    /// Value for recordings without an estimate, in mL; -1 for none.
    #[arg(long, value_name = "ML", default_value_t = PRIOR_ML, allow_negative_numbers = true)]
    prior: f64,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    told: Told,
}

/// Combines and writes.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    publish::check_table(&args.out, args.overwrite)?;
    publish::spare(&args.out, args.inputs.iter().map(PathBuf::as_path))?;
    let (rows, without) = combine_files(&args.inputs, args.prior, &args.out)?;
    args.told.tell(
        || json!({ "out": args.out.display().to_string(), "recordings": rows, "prior": without }),
        || format!("{}: {rows} recordings, {without} with the prior", args.out.display()),
    )?;
    Ok(ExitCode::SUCCESS)
}
