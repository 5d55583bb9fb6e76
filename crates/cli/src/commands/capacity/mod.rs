//! `corsmal-feat capacity`: capacities of containers from the views of a data set.

mod combine;
mod learning;
#[cfg(feature = "nets")]
mod network;
mod source;
mod train;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Subcommand, ValueEnum};
use corsmal_ccm::CcmError;
use corsmal_ccm::capacity::{self, CapacityModel, CapacityOptions, Method, Row};
use corsmal_ccm::submission::RowKey;
use corsmal_vision::cuboid::Outliers;
use serde_json::json;

use crate::args::Told;
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::publish;
use source::{Source, VariantName, learned_containers};

/// Arguments of `capacity`.
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "\
Examples:
  corsmal-feat capacity --method m5 --data ~/CCM --out capacity.csv
  corsmal-feat capacity --method m2 --weights task3.pth --data ~/CCM --out capacity.csv
  corsmal-feat capacity train --method m2 --data ~/CCM --out m2.safetensors
  corsmal-feat capacity train --method fused --data ~/CCM --out fused.capacity
  corsmal-feat capacity --method fused --model fused.capacity --data ~/CCM --out capacity.csv
  corsmal-feat fuse --joint joint.csv --capacity capacity.csv --out submission.csv

The output has one row per recording: estimate in mL (-1: none), uncertainty, sizes, frames
used, status (ok, prior, none, failed) and the reason if there is no estimate. `fuse
--capacity` and `benchmark --add` read it. docs/vision.md lists the files that are looked for.

Exit codes: 0 all fine, 1 some recordings have damaged files, 2 could not run, 130 interrupted."
)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Sub>,
    #[command(flatten)]
    estimate: Option<Estimate>,
}

#[derive(Subcommand)]
enum Sub {
    /// Train a method on the training recordings of a data set.
    Train(train::Args),
    /// Combine the estimates of several frames into one, as M5 does with its two.
    Combine(combine::Args),
}

/// Arguments of an estimate. clap leaves the group of a struct empty that flattens another, so that it would
/// never be seen as given: its members are named.
#[derive(clap::Args)]
#[group(args = ["method", "data", "out"], requires_all = ["method", "data", "out"])]
struct Estimate {
    /// The method.
    #[arg(long, value_enum)]
    method: MethodName,
    #[command(flatten)]
    source: Source,
    /// How closely to follow a published method.
    /// m2, m4 and m5 [default: corrected]
    #[arg(long, value_enum)]
    variant: Option<VariantName>,
    /// How m4 drops outliers; by default as in --variant.
    #[arg(long, value_enum)]
    outliers: Option<OutliersName>,
    /// Model of `capacity train`, for m2, m3 and fused.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Published weights of the network of m2: .pth, .npz or .safetensors with PyTorch's names.
    #[arg(long, value_name = "FILE", conflicts_with = "model")]
    weights: Option<PathBuf>,
    /// Table to write.
    #[arg(long, short, value_name = "CSV")]
    out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    told: Told,
}

#[derive(Clone, Copy, ValueEnum)]
enum MethodName {
    /// A network on the nearest large object in the third view's depth; needs --model or --weights.
    M2,
    /// Gaussian processes on the sizes of detected regions in four views.
    M3,
    /// Cuboid around the points of the first view's depth image.
    M4,
    /// LoDE: circles that fit the masks of both side views.
    M5,
    /// The method that was near on known containers, or else all, weighted by how well each did
    /// (beyond the paper).
    Fused,
}

#[derive(Clone, Copy, ValueEnum)]
enum OutliersName {
    /// Four isolation forests, of which the last has no effect.
    Published,
    /// Four isolation forests.
    Corrected,
    /// No point is dropped.
    Kept,
}

impl MethodName {
    fn method(self) -> Method {
        match self {
            Self::M2 => Method::M2,
            Self::M3 => Method::M3,
            Self::M4 => Method::M4,
            Self::M5 => Method::M5,
            Self::Fused => Method::Fused,
        }
    }
}

/// Estimates, learns or combines.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    match (args.command, args.estimate) {
        (Some(Sub::Train(args)), _) => train::run(args),
        (Some(Sub::Combine(args)), _) => combine::run(&args),
        (None, Some(args)) => estimate(args),
        (None, None) => Err(Failure::new("capacity needs --method, --data and --out; see --help")),
    }
}

fn estimate(args: Estimate) -> Result<ExitCode, Failure> {
    publish::check_table(&args.out, args.overwrite)?;
    let method = args.method.method();
    if args.model.is_some() && !method.learns() {
        return Err(unused("--model", "m2, m3 and fused", method));
    }
    if args.weights.is_some() && method != Method::M2 {
        return Err(unused("--weights", "m2", method));
    }
    if args.variant.is_some() && matches!(method, Method::M3 | Method::Fused) {
        return Err(unused("--variant", "m2, m4 and m5", method));
    }
    if args.outliers.is_some() && method != Method::M4 {
        return Err(unused("--outliers", "m4", method));
    }
    if args.source.seed.is_some() && matches!(method, Method::M2 | Method::M5) {
        return Err(unused("--seed", "m3, m4 and fused", method));
    }
    if args.source.detections.is_some() && method == Method::M2 {
        return Err(unused("--detections", "m3, m4, m5 and fused", method));
    }
    let mut options = args.source.options(method, args.variant.unwrap_or(VariantName::Corrected));
    if let Some(outliers) = args.outliers {
        options.outliers = match outliers {
            OutliersName::Published => Outliers::Published,
            OutliersName::Corrected => Outliers::Corrected,
            OutliersName::Kept => Outliers::Kept,
        };
    }
    read_learned(&mut options, args.model.as_deref(), args.weights.as_deref())?;
    let set = crate::commands::dataset::open(&options.data)?;
    if let Some(folder) = &options.detections
        && let Some(without) = capacity::without_tables(&set.recordings, Some(folder))
    {
        eprintln!("warning: {without}");
    }
    let rows = match capacity::run(&options, &|_, _| {}, crate::interrupt::flag()) {
        Err(error @ CcmError::Interrupted) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        rows => rows?,
    };
    capacity::write(&args.out, &options, &rows)?;
    let count = |status: &str| rows.iter().filter(|r| r.status() == status).count();
    let (measured, prior, none) = (count("ok"), count("prior"), count("none"));
    let (out, recordings, failed) = (&args.out, rows.len(), count("failed"));
    args.told.tell(
        || {
            json!({
                "out": out.display().to_string(), "recordings": recordings, "measured": measured, "prior": prior,
                "without_estimate": none, "failed": failed,
            })
        },
        || {
            format!(
                "{}: {recordings} recordings: {measured} measured, {prior} with the prior, \
                 {none} without an estimate, {failed} failed",
                out.display()
            )
        },
    )?;
    if let Some((name, reason)) = first_failure(&rows) {
        eprintln!("{failed} recordings failed; the first, {name}: {reason}");
        return Ok(ExitCode::from(FAILED_FILES));
    }
    Ok(ExitCode::SUCCESS)
}

fn unused(option: &str, methods: &str, given: Method) -> Failure {
    Failure::new(format!("{option} is for {methods}; --method is {}", given.name()))
}

/// Reads what a method learned into its options; the containers that a model learned from.
pub(super) fn read_learned(
    options: &mut CapacityOptions,
    model: Option<&Path>,
    weights: Option<&Path>,
) -> Result<Vec<u8>, Failure> {
    if options.method == Method::M2 {
        return read_network(options, model, weights);
    }
    options.model = model.map(CapacityModel::read).transpose()?;
    Ok(options.model.as_ref().map(|m| learned_containers(&m.provenance)).unwrap_or_default())
}

#[cfg(feature = "nets")]
fn read_network(
    options: &mut CapacityOptions,
    model: Option<&Path>,
    weights: Option<&Path>,
) -> Result<Vec<u8>, Failure> {
    let (network, containers) = network::read(model, weights)?;
    options.network = Some(network);
    Ok(containers)
}

#[cfg(not(feature = "nets"))]
fn read_network(
    _: &mut CapacityOptions,
    _: Option<&Path>,
    _: Option<&Path>,
) -> Result<Vec<u8>, Failure> {
    Err(super::nets::absent())
}

fn first_failure(rows: &[Row]) -> Option<(String, String)> {
    rows.iter().find_map(|row| match &row.estimate {
        Err(capacity::Problem::Damaged(reason)) => {
            // Ids begin at 0 in every part.
            let name = match row.key {
                RowKey::Id(_) => format!("{} of the {} part", row.key, row.part.name()),
                RowKey::Sequence(..) => row.key.to_string(),
            };
            Some((name, reason.clone()))
        }
        _ => None,
    })
}
