//! `corsmal-feat capacity train`: what M3 and the fused estimate learn.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use corsmal_ccm::CcmError;
use corsmal_ccm::capacity::{self, HeldOut, Method};

use super::source::{Source, VariantName};
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::publish;

/// Arguments of `capacity train`.
#[derive(clap::Args)]
#[command(after_help = "\
A recording with damaged files is left out and named.

Exit codes: 0 all fine, 1 some recordings have damaged files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// The method.
    #[arg(long, value_enum)]
    method: Learning,
    #[command(flatten)]
    source: Source,
    /// Model to write.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
    /// Print only warnings and errors.
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
    let capacity::Learned { model, held_out, recordings, failed } =
        match capacity::train(&options, &|_, _| {}, crate::interrupt::flag()) {
            Err(error @ CcmError::Interrupted) => {
                eprintln!("{error}");
                return Ok(ExitCode::from(INTERRUPTED));
            }
            model => model?,
        };
    model.write(&args.out)?;
    if !args.quiet {
        let used = &model.provenance["with_container"];
        println!("{}: learned from {used} of {recordings} recordings", args.out.display());
        if model.provenance["synthetic"] == true {
            println!("SYNTHETIC data: scores mean nothing about real recordings");
        }
        if let Some(held_out) = held_out {
            print_scores(&held_out);
        }
    }
    if !failed.is_empty() {
        for (key, reason) in &failed {
            eprintln!("{key}: {reason}");
        }
        eprintln!(
            "{} of {recordings} recordings have damaged files and taught nothing",
            failed.len()
        );
        return Ok(ExitCode::from(FAILED_FILES));
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
