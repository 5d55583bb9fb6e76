//! `corsmal-feat merge`: the outputs of all shards of a run into one.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_extract::merge::Existing;
use serde_json::json;

use crate::args::Told;
use crate::failure::Failure;
use crate::plural::plural;

/// Arguments of `merge`.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  corsmal-feat extract --in audio/ --out part0.npz --shard 0/2
  corsmal-feat extract --in audio/ --out part1.npz --shard 1/2
  corsmal-feat merge part0.npz part1.npz --out feats.npz

The result has the same bytes as one run over all inputs. Shards whose summaries differ in width
(recordings with other channel counts) do not fit into one table and are refused.")]
pub struct Args {
    /// The outputs of all shards, in any order.
    #[arg(required = true)]
    shards: Vec<PathBuf>,
    /// The merged output.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
    /// Continue an interrupted merge.
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    #[command(flatten)]
    told: Told,
}

/// Merges shards.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let existing = match (args.overwrite, args.resume) {
        (true, _) => Existing::Overwrite,
        (_, true) => Existing::Resume,
        _ => Existing::Keep,
    };
    corsmal_extract::merge::merge(&args.shards, &args.out, existing)?;
    args.told.tell(
        || json!({ "out": args.out, "shards": args.shards }),
        || format!("{}: {} merged", args.out.display(), plural(args.shards.len(), "shard")),
    )?;
    Ok(ExitCode::SUCCESS)
}
