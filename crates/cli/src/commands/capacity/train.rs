//! `corsmal-feat capacity train`: what M2, M3 and the fused estimate learn.

use std::process::ExitCode;

use corsmal_ccm::CcmError;
use corsmal_ccm::capacity::{self, HeldOut, Method};
use serde_json::json;

pub use super::learning::Args;
use super::learning::{Learning, SYNTHETIC, ended};
use super::source::VariantName;
use crate::failure::{Failure, INTERRUPTED};
use crate::publish;

/// Learns and writes.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    publish::check(&args.out, args.overwrite)?;
    let learns_by_steps = !args.parameters.is_empty() || args.checkpoints.is_some();
    let method = match args.method {
        Learning::M2 if args.source.detections.is_some() => {
            return Err(super::unused("--detections", "m3 and fused", Method::M2));
        }
        Learning::M2 => return network(args),
        _ if learns_by_steps => {
            return Err(Failure::new(
                "--set and --checkpoints are for --method m2, which trains a network",
            ));
        }
        Learning::M3 => Method::M3,
        Learning::Fused => Method::Fused,
    };
    let options = args.source.options(method, VariantName::Corrected);
    crate::commands::dataset::open(&options.data)?;
    let capacity::Learned { model, held_out, recordings, failed } =
        match capacity::train(&options, &|_, _| {}, crate::interrupt::flag()) {
            Err(error @ CcmError::Interrupted) => {
                eprintln!("{error}");
                return Ok(ExitCode::from(INTERRUPTED));
            }
            model => model?,
        };
    model.write(&args.out)?;
    let used = &model.provenance["with_container"];
    if args.told.json {
        let summary = json!({
            "out": args.out.display().to_string(), "recordings": recordings, "used": used, "failed": failed.len(),
            "synthetic": model.provenance["synthetic"],
        });
        println!("{}", serde_json::to_string_pretty(&summary)?);
    } else if !args.told.quiet {
        println!("{}: learned from {used} of {recordings} recordings", args.out.display());
        if model.provenance["synthetic"] == true {
            println!("{SYNTHETIC}");
        }
        if let Some(held_out) = held_out {
            print_scores(&held_out);
        }
    }
    Ok(ended(&failed, recordings))
}

#[cfg(feature = "nets")]
fn network(args: Args) -> Result<ExitCode, Failure> {
    super::network::train(args)
}

#[cfg(not(feature = "nets"))]
fn network(_: Args) -> Result<ExitCode, Failure> {
    Err(crate::commands::nets::absent())
}

/// Scores on held-out containers, in percent.
fn print_scores(held_out: &HeldOut) {
    println!(
        "mean score in percent, each container estimated from what was learned on the others:"
    );
    for (category, methods) in held_out {
        let scores = methods.iter().map(|(method, score)| format!("{method} {:.1}", score * 100.0));
        println!("  {:6} {}", category.name(), scores.collect::<Vec<_>>().join("  "));
    }
}
