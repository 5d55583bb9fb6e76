//! `corsmal-feat merge`: the outputs of all shards of a run into one.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_extract::merge::{Existing, MergeError, stored};
use corsmal_extract::run::RunError;
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
(because their recordings differ in channels) do not fit into one table and are refused.")]
pub struct Args {
    /// The outputs of all shards, in any order: files, or objects in a store.
    #[arg(required = true)]
    shards: Vec<PathBuf>,
    /// The merged output: a file, or an object in a store (s3://bucket/feats.npz).
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Folder for copies of shards in a store, and for an output on its way to a store; the current
    /// folder by default.
    #[arg(long, value_name = "FOLDER")]
    work: Option<PathBuf>,
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
    let place = (args.out.as_path(), args.work.as_deref());
    match stored::merge(&args.shards, place, existing, crate::interrupt::flag()) {
        Err(MergeError::Run(error @ RunError::Interrupted)) => {
            return Err(Failure::interrupted(error.to_string()));
        }
        merged => {
            if let Some(warning) = merged? {
                eprintln!("warning: {warning}");
            }
        }
    }
    args.told.tell(
        || {
            let shards = args.shards.iter().map(|shard| shard.display().to_string());
            json!({ "out": args.out.display().to_string(), "shards": shards.collect::<Vec<_>>() })
        },
        || format!("{}: {} merged", args.out.display(), plural(args.shards.len(), "shard")),
    )?;
    Ok(ExitCode::SUCCESS)
}
