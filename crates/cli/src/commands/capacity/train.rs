//! `corsmal-feat capacity train`: what M3 and the fused estimate learn.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use corsmal_ccm::CcmError;
use corsmal_ccm::capacity::{self, HeldOut, Method};

use super::source::{Source, VariantName};
use crate::failure::{Failure, INTERRUPTED};
use crate::publish;

/// Arguments of `capacity train`.
#[derive(clap::Args)]
pub struct Args {
    /// The method.
    #[arg(long, value_enum)]
    method: Learning,
    #[command(flatten)]
    source: Source,
    /// Model to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
    /// Print nothing.
    #[arg(long, short)]
    quiet: bool,
}

/// Methods that learn.
#[derive(Clone, Copy, ValueEnum)]
enum Learning {
    /// Gaussian processes on the sizes of detected regions.
    M3,
    /// The same, and bias and spread of all methods.
    Fused,
}

/// Learns and writes.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    publish::check(&args.out, args.overwrite)?;
    let method = match args.method {
        Learning::M3 => Method::M3,
        Learning::Fused => Method::Fused,
    };
    let options = args.source.options(method, VariantName::Corrected);
    let (model, held_out) = match capacity::train(&options, &|_, _| {}, crate::interrupt::flag()) {
        Err(error @ CcmError::Interrupted) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        model => model?,
    };
    model.write(&args.out)?;
    if !args.quiet {
        let (all, used) = (&model.provenance["recordings"], &model.provenance["with_container"]);
        println!("{}: learned from {used} of {all} recordings", args.out.display());
        if model.provenance["synthetic"] == true {
            println!("SYNTHETIC data: scores mean nothing about real recordings");
        }
        if let Some(held_out) = held_out {
            print_scores(&held_out);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Scores on held-out containers, in percent.
fn print_scores(held_out: &HeldOut) {
    println!("mean score in percent, each container estimated by what the others taught:");
    for (category, methods) in held_out {
        let scores = methods.iter().map(|(method, score)| format!("{method} {:.1}", score * 100.0));
        println!("  {:6} {}", category.name(), scores.collect::<Vec<_>>().join("  "));
    }
}
