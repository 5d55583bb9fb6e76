//! `corsmal-feat compare-predictions`: whether two classifiers differ on the same recordings.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_models::comparison::{Bootstrap, compare};
use corsmal_models::predictions::PredictionTable;

use crate::args::LabelArgs;
use crate::failure::Failure;
use crate::text_table::{TextTable, percent};

/// Arguments of `compare-predictions`.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  corsmal-feat cross-validate … --classifier svm --predictions svm.csv
  corsmal-feat cross-validate … --classifier rf --predictions rf.csv
  corsmal-feat compare-predictions svm.csv rf.csv

McNemar's exact test looks at the rows that only one of the two got right. The bootstrap
draws rows, whole groups if there are any, and whole folds if all rows have one, with replacement,
and gives a 95 % interval of the difference of weighted F1. Rows of one group, such as windows of one
recording, resemble each other, so the interval over groups is the honest one; that of fewer than ten
rows, groups or folds says little, and has no p value.

Exit codes: 0 fine, 2 could not run.")]
pub struct Args {
    /// Predictions of the first classifier, with true classes.
    #[arg(value_name = "CSV")]
    first: PathBuf,
    /// Predictions of the second classifier for the same recordings.
    #[arg(value_name = "CSV")]
    second: PathBuf,
    #[command(flatten)]
    labels: LabelArgs,
    /// Column of the true classes; by default the only label column of --labels, else `true`.
    #[arg(long, visible_alias = "y", value_name = "COLUMN")]
    target: Option<String>,
    /// Column of groups that are drawn together; by default a column group, container or recording.
    #[arg(long, value_name = "COLUMN")]
    groups: Option<String>,
    /// Number of bootstrap resamples.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    resamples: u32,
    /// Seed of the bootstrap.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Print everything as JSON.
    #[arg(long)]
    json: bool,
}

/// Compares and prints.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let target = args.target.as_deref();
    let source = args.labels.source(target)?;
    let read = |path: &PathBuf| -> Result<(PredictionTable, Option<String>), Failure> {
        let mut table = PredictionTable::read(path)?;
        let target = match &source {
            Some(source) => table.add_labels(source, target, args.groups.as_deref())?,
            None => target.map(String::from),
        };
        Ok((table, target))
    };
    let ((first, target), (second, _)) = (read(&args.first)?, read(&args.second)?);
    let draws = args.resamples as usize;
    let columns = (target.as_deref(), args.groups.as_deref());
    let report = compare(&first, &second, columns, draws, args.seed)?;
    for warning in &report.warnings {
        eprintln!("warning: {warning}");
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(ExitCode::SUCCESS);
    }
    let mut table = TextTable::new(["percent", "accuracy", "weighted F1"]);
    for (path, compared) in [(&args.first, &report.first), (&args.second, &report.second)] {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().to_string();
        let scores = &compared.scores;
        table.row([name, percent(scores.accuracy), percent(scores.weighted_f1)]);
    }
    println!("{}", table.text());
    let test = &report.mcnemar;
    println!(
        "\nMcNemar: {} right only in the first, {} only in the second of {}; p {}",
        test.only_first,
        test.only_second,
        report.rows,
        probability(test.p_value, 1e-4)
    );
    let rows = if report.grouped_by.is_some() { "rows" } else { "recordings" };
    print(rows, &report.bootstrap_rows, args.resamples);
    if let Some((by_group, column)) =
        report.bootstrap_groups.as_ref().zip(report.grouped_by.as_ref())
    {
        print(&format!("{} groups (column {column})", report.groups), by_group, args.resamples);
    }
    if let Some(by_fold) = &report.bootstrap_folds {
        print(&format!("{} folds", report.folds), by_fold, args.resamples);
    }
    Ok(ExitCode::SUCCESS)
}

fn print(unit: &str, result: &Bootstrap, draws: u32) {
    let p = match result.p_value {
        Some(p) => {
            // The least that so many draws show, rounded up to what is printed.
            let least = 2.0 / (f64::from(draws) + 1.0);
            let shown = if p <= least { (least * 1e4).ceil() / 1e4 } else { least };
            format!("p {}", probability(p, shown.min(1.0)))
        }
        None => "too few for a p value".into(),
    };
    println!(
        "bootstrap over {unit}: weighted F1 of the second {:+.2} points, 95 % interval {:+.2} to \
         {:+.2}; {p}",
        100.0 * result.difference,
        100.0 * result.low,
        100.0 * result.high,
    );
}

/// `= 0.0312`, or that it is below the least that can be told.
fn probability(p: f64, least: f64) -> String {
    if p < least { format!("< {least}") } else { format!("= {p:.4}") }
}
