//! `corsmal-feat benchmark`: the paper's audio baselines on a CCM data set.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_ccm::CcmError;
use corsmal_ccm::benchmark::{self, Baseline, Options};

use crate::args::Jobs;
use crate::failure::{Failure, INTERRUPTED};

/// Arguments of `benchmark`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  corsmal-feat benchmark --data ~/CCM --out report\n  \
                        corsmal-feat benchmark --data ~/CCM --out report --baselines zcr-mfcc-rf \
                        --add M6=m6_acc.csv\n\nThe report is report/report.html; the same tables \
                        are in report/tables and report/report.json.")]
pub struct Args {
    /// Folder of the data set.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder for the report, tables, pictures, submissions, models and cached features.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Baselines to run, such as zcr-mfcc-knn or spectrogram-pca-rf; default all twelve.
    #[arg(long, num_args = 1.., value_delimiter = ',', value_parser = baseline, value_name = "NAME")]
    baselines: Vec<Baseline>,
    /// Predictions of another method that join the tables: a submission in an official format or
    /// capacity estimates by file name.
    #[arg(long, value_parser = named_file, value_name = "NAME=CSV")]
    add: Vec<(String, PathBuf)>,
    /// Seed of the forests and of the pseudo-random estimates.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    jobs: Jobs,
    /// Do not say what is being done.
    #[arg(long)]
    quiet: bool,
}

fn baseline(name: &str) -> Result<Baseline, String> {
    let all = Baseline::all();
    all.iter().find(|b| b.slug() == name).copied().ok_or_else(|| {
        let known: Vec<_> = all.iter().map(Baseline::slug).collect();
        format!("known are {}", known.join(", "))
    })
}

fn named_file(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => {
            Ok((name.to_string(), path.into()))
        }
        _ => Err("expected NAME=FILE such as M6=m6_acc.csv".into()),
    }
}

/// Runs the baselines and writes the report.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let baselines = if args.baselines.is_empty() { Baseline::all() } else { args.baselines };
    let options = Options {
        data: args.data,
        out: args.out,
        baselines,
        added: args.add,
        jobs: args.jobs.count(),
        seed: args.seed,
    };
    let quiet = args.quiet;
    let progress = |step: &str| {
        if !quiet {
            eprintln!("{step}");
        }
    };
    let report = match benchmark::run(&options, &progress, crate::interrupt::flag()) {
        Err(error @ CcmError::Interrupted) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        report => report?,
    };
    if !quiet {
        if let Some(warning) = &report.warning {
            println!("{warning}");
        }
        println!("{}", options.out.join("report.html").display());
    }
    Ok(ExitCode::SUCCESS)
}
