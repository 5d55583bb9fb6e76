//! `corsmal-feat benchmark`: the paper's audio baselines on a CCM data set.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_ccm::CcmError;
use corsmal_ccm::benchmark::{self, Baseline, BenchmarkOptions, Made};
use corsmal_report::{Cell, Report, Row, Source};

use crate::args::Jobs;
use crate::failure::{Failure, INTERRUPTED};
use crate::made;

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
    /// Print the whole report as JSON instead of its main scores.
    #[arg(long)]
    json: bool,
    /// Suppress progress messages.
    #[arg(short, long)]
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
    let options = BenchmarkOptions {
        data: args.data,
        out: args.out,
        baselines,
        added: args.add,
        jobs: args.jobs.count(),
        seed: args.seed,
        made: Made { on: Some(made::today()), command: Some(made::command()) },
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
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else if !quiet {
        print!("{}", scores(&report));
        if let Some(warning) = &report.warning {
            println!("{warning}\n");
        }
        println!("{}", options.out.join("report.html").display());
    }
    Ok(ExitCode::SUCCESS)
}

/// The scores of this run on recordings that were not trained on, from the report's tables of the
/// two classification tasks.
fn scores(report: &Report) -> String {
    const TASKS: [(&str, &str); 2] = [("level", "filling level"), ("type", "filling type")];
    let tables = report.sections.iter().flat_map(|s| &s.tables);
    let rows = |name: &str| -> Vec<&Row> {
        let table = tables.clone().find(|t| t.name == name);
        let rows = table.into_iter().flat_map(|t| &t.rows);
        rows.filter(|row| row.source != Source::Paper).collect()
    };
    let [levels, types] = TASKS.map(|(name, _)| rows(name));
    let word = |cell: Option<&Cell>| match cell {
        Some(Cell::Text(text)) => text.clone(),
        _ => String::new(),
    };
    // Method, inputs, protocol, then the score on the training part.
    let score = |cell: Option<&Cell>| match cell {
        Some(Cell::Score(value, Some((low, high)))) => {
            format!("{value:6.2}  ({low:.1} to {high:.1})")
        }
        Some(Cell::Score(value, None)) => format!("{value:6.2}"),
        _ => "     \u{2013}".into(),
    };
    let width = levels.iter().map(|r| word(r.cells.first()).chars().count()).max().unwrap_or(6);
    let mut out = format!(
        "\nweighted F1 on training recordings that were not trained on, percent (95 % interval)\n\n\
         {:width$}  {:10}  {:24}{}\n",
        "method", "protocol", TASKS[0].1, TASKS[1].1
    );
    for row in levels {
        let (method, protocol) = (word(row.cells.first()), word(row.cells.get(2)));
        let same = |other: &&&Row| {
            word(other.cells.first()) == method && word(other.cells.get(2)) == protocol
        };
        let other = types.iter().find(same).and_then(|r| r.cells.get(3));
        let (level, kind) = (score(row.cells.get(3)), score(other));
        out.push_str(&format!("{method:width$}  {protocol:10}  {level:24}{kind}\n"));
    }
    out + "\n"
}
