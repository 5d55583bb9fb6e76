//! `corsmal-feat score`: how good predictions are.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_models::predictions::PredictionTable;
use corsmal_models::scores::{ClassReport, Interval, NumericScores, ScoreReport, Scoring};

use crate::args::LabelArgs;
use crate::failure::Failure;
use crate::plural::plural;
use crate::study::{self, Scored};
use crate::text_table::{TextTable, confusion, percent};

/// Arguments of `score`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat score held-out.csv
  corsmal-feat score predictions.csv --labels labels.csv --target type --groups container
  corsmal-feat score predictions.csv --labels meta.csv --id-column file --target class --reject 0.6
  corsmal-feat score held-out.csv --report report
  corsmal-feat score capacities.csv --labels labels.csv --target capacity

Prediction files come from `classify`, `cross-validate --predictions` and `fuse`. The scores are
accuracy, weighted and macro F1 with 95 % bootstrap intervals, scores of each class, the confusion
matrix, calibration (Brier score, ECE), and areas under the ROC and precision-recall curves. Lines
without a prediction count as wrong. A numeric target gives errors and the score of the CORSMAL
challenge. CORSMAL submissions have their own rules: `corsmal-feat evaluate`.

Exit codes: 0 fine, 2 could not run.")]
pub struct Args {
    /// Prediction file.
    #[arg(value_name = "CSV")]
    predictions: PathBuf,
    #[command(flatten)]
    labels: LabelArgs,
    /// Column of the true classes; by default the only label column of --labels, else `true`, or
    /// `class` with --labels folders.
    #[arg(long, visible_alias = "y", value_name = "COLUMN")]
    target: Option<String>,
    /// Column of groups that the bootstrap draws together; by default group, container or recording
    /// if there is one, else single lines are drawn.
    #[arg(long, value_name = "COLUMN")]
    groups: Option<String>,
    /// Call predictions unknown if their highest probability is below P; they count as wrong.
    #[arg(long, value_name = "P", default_value_t = 0.0, value_parser = crate::args::share)]
    reject: f64,
    /// Treat the target as a number even if all its values are whole.
    #[arg(long)]
    numeric: bool,
    /// Number of bootstrap resamples.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    resamples: u32,
    /// Seed of the bootstrap.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Write a report into this folder: report.html with scores, confusion matrix, curves, errors worth
    /// listening to and, if the recordings are still at their paths, their health; tables as CSV and
    /// LaTeX, figures as SVG and PDF.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Replace the report in this folder.
    #[arg(long)]
    overwrite: bool,
    /// Print everything as JSON, including the curves.
    #[arg(long)]
    json: bool,
}

/// Scores and prints.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    if let Some(folder) = &args.report {
        study::prepare(folder, args.overwrite)?;
    }
    let mut table = PredictionTable::read(&args.predictions)?;
    let mut target = args.target.clone();
    if let Some(source) = args.labels.source(target.as_deref())? {
        target = table.add_labels(&source, target.as_deref(), args.groups.as_deref())?;
    }
    let scoring = Scoring {
        target,
        groups: args.groups,
        reject: args.reject,
        numeric: args.numeric,
        draws: args.resamples as usize,
        seed: args.seed,
    };
    let report = table.score(&scoring)?;
    if let Some(folder) = &args.report {
        let scored = |predictions| Scored {
            predictions,
            labels: args.labels.file(),
            target: scoring.target.as_deref(),
            scoring: &scoring,
        };
        match &report {
            ScoreReport::Classes(report) => {
                if scoring.reject > 0.0 {
                    table.reject_below(scoring.reject)?;
                }
                study::write_scored(folder, &scored(&table), report)?;
            }
            ScoreReport::Numbers(scores) => {
                let measures = number_measures(scores);
                let measures = measures.map(|(name, value)| (name.trim().to_owned(), value));
                study::write_estimates(folder, &scored(&table), measures.to_vec())?;
            }
        }
    }
    warn(&table, &scoring, &report)?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(ExitCode::SUCCESS);
    }
    match report {
        ScoreReport::Classes(report) => {
            println!("{}, {}", plural(report.rows, "row"), plural(report.labels.len(), "class"));
            print_overall(&report);
            println!();
            print_classes(&report);
        }
        ScoreReport::Numbers(scores) => print_numbers(&scores),
    }
    Ok(ExitCode::SUCCESS)
}

fn interval(interval: &Interval) -> [String; 2] {
    [percent(interval.low), percent(interval.high)]
}

/// Scores of all rows together, with their intervals and those of the probabilities.
pub fn print_overall(report: &ClassReport) {
    let (s, i) = (&report.scores, &report.intervals);
    if report.unknown > 0 {
        println!(
            "{} without a prediction count{} as wrong; accuracy of the others {} %",
            report.unknown,
            if report.unknown == 1 { "s" } else { "" },
            percent(report.accuracy_of_known)
        );
    }
    println!();
    let mut table = TextTable::new(["all rows, percent", "score", "95 % CI from", "to"]);
    for (name, score, bounds) in [
        ("accuracy", s.accuracy, &i.accuracy),
        ("weighted F1", s.weighted_f1, &i.weighted_f1),
        ("macro F1", s.macro_f1, &i.macro_f1),
    ] {
        table.row([name.to_string(), percent(score)].into_iter().chain(interval(bounds)));
    }
    println!("{}", table.text());
    print_drawn(&report.drawn, report.units);
    if let Some(calibration) = &report.calibration {
        println!(
            "\nBrier score {:.4}, expected calibration error {:.4}",
            calibration.brier, calibration.ece
        );
    }
    if let (Some(roc), Some(precision)) = (report.roc_auc, report.average_precision) {
        println!(
            "area under the ROC curve {roc:.4}, average precision {precision:.4} (class means)"
        );
    }
}

/// What the intervals are drawn over.
fn print_drawn(drawn: &str, units: usize) {
    match drawn {
        "rows" => {
            println!("bootstrap over {units} rows");
            println!(
                "rows of one person, place or device are not independent: name them with --groups"
            );
        }
        column => println!("bootstrap over {units} groups (column {column})"),
    }
    if units < 10 {
        println!("with so few of them, the interval says little");
    }
}

/// Scores of each class, and the confusion matrix.
pub fn print_classes(report: &ClassReport) {
    let curves = report.curves.as_deref().unwrap_or_default();
    let heads = ["class, percent", "precision", "recall", "F1", "ROC area", "rows"];
    let mut table = TextTable::new(heads);
    for (at, (name, c)) in report.labels.iter().zip(&report.scores.classes).enumerate() {
        let area =
            curves.get(at).and_then(Option::as_ref).map_or(String::new(), |c| percent(c.roc_auc));
        table.row([
            name.clone(),
            percent(c.precision),
            percent(c.recall),
            percent(c.f1),
            area,
            c.support.to_string(),
        ]);
    }
    println!("{}\n", table.text());
    println!("{}", confusion(&report.labels, &report.scores.confusion, &report.scores.unknown));
}

/// Measures of the errors of estimated numbers, as text.
fn number_measures(scores: &NumericScores) -> [(&'static str, String); 7] {
    [
        ("mean absolute error", format!("{:.4}", scores.mean_absolute_error)),
        ("root mean squared error", format!("{:.4}", scores.root_mean_squared_error)),
        ("mean relative error, percent", percent(scores.mean_relative_error)),
        ("R squared", format!("{:.4}", scores.r2)),
        ("CORSMAL score, percent", percent(scores.score)),
        ("  95 % CI from", percent(scores.score_interval.low)),
        ("  95 % CI to", percent(scores.score_interval.high)),
    ]
}

fn print_numbers(scores: &NumericScores) {
    println!("{}, {} without an estimate\n", plural(scores.rows, "row"), scores.unknown);
    let mut table = TextTable::new(["error", "value"]);
    for (name, value) in number_measures(scores) {
        table.row([name.to_string(), value]);
    }
    println!("{}", table.text());
    print_drawn(&scores.drawn, scores.units);
}

/// Says what the scores may not be meant to be.
fn warn(table: &PredictionTable, scoring: &Scoring, report: &ScoreReport) -> Result<(), Failure> {
    let place = table.path.display();
    let warnings = match report {
        ScoreReport::Classes(report) => &report.warnings,
        ScoreReport::Numbers(scores) => &scores.warnings,
    };
    for warning in warnings {
        eprintln!("warning: {place}: {warning}");
    }
    let report = match report {
        ScoreReport::Classes(report) => report,
        ScoreReport::Numbers(_) => {
            let truth = table.truth(scoring.target.as_deref())?;
            let whole = |text: &&str| text.parse::<f64>().is_ok_and(|value| value.fract() == 0.0);
            if !scoring.numeric && truth.iter().all(whole) {
                eprintln!(
                    "note: {place}: true values with a decimal point are scored as numbers; write \
                     classes without one"
                );
            }
            return Ok(());
        }
    };
    let whole = |name: &String| name.parse::<i64>().is_ok();
    let has_proba = table.rows.iter().any(|row| row.proba.is_some());
    if !has_proba && !report.labels.is_empty() && report.labels.iter().all(whole) {
        eprintln!(
            "note: {place}: whole numbers are scored as classes; --numeric scores them as numbers"
        );
    }
    Ok(())
}
