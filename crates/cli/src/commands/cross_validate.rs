//! `corsmal-feat cross-validate`: scores on rows that were not trained on.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use corsmal_models::cross_validation::CrossValidation;
use corsmal_models::cv_plan::CvPlan;
use corsmal_models::dataset::LabelledTable;
use corsmal_models::folds::Folds;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::predictions::PredictionTable;
use corsmal_models::scores::{ClassReport, Scores};
use corsmal_models::spread::Spread;
use corsmal_models::validation::{Validation, validate};
use corsmal_report::Fact;
use serde::Serialize;

use super::score::{print_classes, print_overall};
use crate::args::{DatasetArgs, Jobs, NetworkArgs, PipelineArgs};
use crate::failure::Failure;
use crate::output::{self, is_stdout};
use crate::publish;
use crate::study::{self, Explained, HeldOut};
use crate::text_table::{TextTable, percent};

/// Arguments of `cross-validate`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat cross-validate feats.npz --labels labels.csv --target type \\
    --groups container --classifier rf --set trees=500
  corsmal-feat cross-validate feats.npz --labels folders --cv 5
  corsmal-feat cross-validate a34f_train.npz --target level --groups container \\
    --cv lists=1,4,7/2,5,8/3,6,9 --classifier svm --standardize \\
    --tune C=1,10 --tune gamma=scale,0.01
  corsmal-feat cross-validate feats.npz --labels labels.csv --report report

With --tune the parameters are chosen separately in every fold, on inner folds of its training rows.
`score` reports more about the --predictions; `compare-predictions` tests whether those of two runs
differ.

Exit codes: 0 fine, 2 could not run, 130 interrupted.")]
pub struct Args {
    #[command(flatten)]
    dataset: DatasetArgs,
    #[command(flatten)]
    pipeline: PipelineArgs,
    #[command(flatten)]
    network: NetworkArgs,
    /// What is held out: N or k=N folds (of whole groups with --groups, else stratified),
    /// group=COLUMN (each group once), lists=1,4,7/2,5,8/3,6,9 of --groups, or fold=COLUMN. By
    /// default each group of --groups or of a label column container or group, else 5 folds.
    #[arg(long, value_name = "PLAN")]
    cv: Option<CvPlan>,
    /// Print everything as JSON instead of tables.
    #[arg(long)]
    json: bool,
    /// Write the predictions of the held-out rows to this CSV; '-', with --quiet, is standard output.
    #[arg(long, short = 'o', value_name = "CSV")]
    predictions: Option<PathBuf>,
    /// Write a report into this folder: report.html with scores, confusion matrix, curves, errors
    /// worth listening to, the health of the recordings, which features matter and whether more rows
    /// would help; tables as CSV and LaTeX, figures as SVG and PDF. This trains about six times as
    /// many models; with --net, the parts that would train again are left out.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Repeat with N seeds, starting at --seed, to see how much of a difference between two
    /// classifiers is chance.
    #[arg(long, value_name = "N", conflicts_with = "net", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: u32,
    /// Replace an existing prediction file, and the report in its folder.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    jobs: Jobs,
    /// Print only warnings and errors.
    #[arg(long, short)]
    quiet: bool,
}

/// Validates and prints.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    args.jobs.pool()?.install(|| cross_validate(&args))
}

fn cross_validate(args: &Args) -> Result<ExitCode, Failure> {
    if let Some(path) = args.predictions.as_deref().filter(|path| is_stdout(path)) {
        if args.json || !args.quiet {
            let message = format!(
                "--predictions {}: the scores are printed there, too; name a file, or add --quiet and leave out \
                 --json",
                path.display()
            );
            return Err(Failure::new(message));
        }
    } else if let Some(path) = &args.predictions {
        publish::check_table(path, args.overwrite)?;
        publish::spare(path, args.dataset.files().into_iter().chain(args.network.weights.clone()))?;
    }
    if let Some(folder) = &args.report {
        study::prepare(folder, args.overwrite)?;
    }
    if let Some(name) = &args.network.net {
        return validate_network(args, name);
    }
    let candidates = args.pipeline.candidates()?;
    let (table, target) = args.dataset.load()?;
    let groups = args.dataset.groups.as_deref();
    let plan = (args.cv.as_ref(), groups);
    let validation = validate(&table, &target, candidates, plan, args.pipeline.seed())?;
    for warning in &validation.warnings {
        eprintln!("warning: {warning}");
    }
    let held_out = Path::new("the held-out predictions");
    let predictions =
        validation.predictions(&table.ids, args.predictions.as_deref().unwrap_or(held_out));
    if let Some(path) = &args.predictions {
        output::write(path, &predictions.to_csv()?)?;
    }
    let others = (1..args.seeds).map(|more| args.pipeline.seed().wrapping_add(more));
    let mut is_seeded = false;
    let others = others.map(|seed| {
        let candidates = args.pipeline.candidates_with(seed)?;
        let found = validate(&table, &target, candidates, plan, seed)?;
        is_seeded |= found.candidates != validation.candidates
            || found.folds.outer != validation.folds.outer
            || found.candidates.len() > 1 && found.folds.choice_groups().is_none();
        Ok((seed, found.result.pooled))
    });
    let others = others.collect::<Result<Vec<_>, Failure>>()?;
    if args.seeds > 1 && !is_seeded {
        eprintln!(
            "warning: --seeds {}: neither the folds nor the classifier use the seed, so all runs are the same",
            args.seeds
        );
    }
    let all_seeds = Seeds::of(args.pipeline.seed(), &validation.result.pooled, &others);
    if args.json {
        let output = Output { validation: &validation, seeds: all_seeds };
        println!("{}", serde_json::to_string_pretty(&output)?);
    } else if !args.quiet {
        print(args, &table, &validation, all_seeds.as_ref());
    }
    if let Some(folder) = &args.report {
        report(
            folder,
            (&table, args.dataset.label_file()),
            &validation,
            (&predictions, &others),
            args.quiet,
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What --json prints.
#[derive(Serialize)]
struct Output<'a> {
    #[serde(flatten)]
    validation: &'a Validation,
    #[serde(skip_serializing_if = "Option::is_none")]
    seeds: Option<Seeds>,
}

/// The scores of all held-out rows with several seeds.
#[derive(Serialize)]
struct Seeds {
    first: u32,
    accuracy: Vec<f64>,
    weighted_f1: Vec<f64>,
    macro_f1: Vec<f64>,
}

impl Seeds {
    /// `None` for a single seed.
    fn of(first: u32, scores: &Scores, others: &[(u32, Scores)]) -> Option<Self> {
        let all = || std::iter::once(scores).chain(others.iter().map(|(_, scores)| scores));
        (!others.is_empty()).then(|| Self {
            first,
            accuracy: all().map(|s| s.accuracy).collect(),
            weighted_f1: all().map(|s| s.weighted_f1).collect(),
            macro_f1: all().map(|s| s.macro_f1).collect(),
        })
    }

    fn print(&self) {
        let heads = [&format!("{} seeds, percent", self.accuracy.len()), "mean", "± std", "least"];
        let mut table = TextTable::new(heads.into_iter().chain(["most"]));
        for (name, values) in [
            ("accuracy", &self.accuracy),
            ("weighted F1", &self.weighted_f1),
            ("macro F1", &self.macro_f1),
        ] {
            let spread = Spread::of(values);
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(0.0, f64::max);
            let cells = [spread.mean, spread.std, least, most].map(percent);
            table.row(std::iter::once(name.to_owned()).chain(cells));
        }
        println!("\n{}", table.text());
    }
}

fn report(
    folder: &Path,
    (table, labels): (&LabelledTable, Option<&Path>),
    validation: &Validation,
    (predictions, seeds): (&PredictionTable, &[(u32, Scores)]),
    quiet: bool,
) -> Result<(), Failure> {
    // The pipeline of most folds, where it was chosen anew in each.
    let candidates = &validation.candidates;
    let folds_of = |at: &usize| {
        let folds = validation.result.folds.iter();
        folds.filter(|fold| fold.chosen == *at).count()
    };
    let most = (0..candidates.len()).rev().max_by_key(folds_of).unwrap_or(0);
    let spec = &candidates[most];
    let classifier = match candidates.len() {
        1 => spec.describe(),
        n => format!(
            "chosen in every fold among {n}; most often {}",
            spec.describe_among(candidates)
        ),
    };
    let held_out = HeldOut {
        table,
        labels,
        target: &validation.target,
        classes: &validation.classes,
        folds: &validation.folds,
        result: &validation.result,
        predictions,
        scores: &validation.held_out,
        seeds,
        warnings: table.doubts().into_iter().chain(validation.warnings.clone()).collect(),
        facts: vec![
            Fact::new(
                "Rows and features",
                format!("{} × {}", validation.rows, validation.n_features),
            ),
            Fact::new("Classifier", classifier),
            Fact::new("Seed", validation.seed.to_string()),
        ],
        quiet,
    };
    held_out.write(folder, Some(&Explained { spec, seed: validation.seed }))
}

fn print(args: &Args, table: &LabelledTable, validation: &Validation, seeds: Option<&Seeds>) {
    println!(
        "features  {}: {} rows x {} features",
        table.path.display(),
        validation.rows,
        validation.n_features
    );
    println!("target    {}, {} classes", validation.target, validation.labels.len());
    match validation.candidates.as_slice() {
        [only] => println!("pipeline  {}", only.describe()),
        many => println!("pipeline  chosen in every fold among {}", many.len()),
    }
    println!("held out  {}\n", validation.folds_by);
    print_folds(&validation.result, &validation.candidates, &validation.folds);
    if let Some(seeds) = seeds {
        seeds.print();
    }
    print_held_out(&validation.held_out);
    match (&args.report, &args.predictions) {
        (Some(_), _) => println!(),
        (None, Some(path)) => {
            println!("\nnext: corsmal-feat score {} --report DIR", path.display());
        }
        (None, None) => {
            println!("\nnext: the same command with --report DIR writes a report to look at")
        }
    }
}

fn print_held_out(report: &ClassReport) {
    print_overall(report);
    println!();
    print_classes(report);
}

#[cfg(feature = "nets")]
fn validate_network(args: &Args, name: &str) -> Result<ExitCode, Failure> {
    let Args { dataset, pipeline, network, quiet, jobs, .. } = args;
    let (jobs, quiet) = (jobs.count(), *quiet);
    let request = crate::networks::Request { dataset, pipeline, network, jobs, quiet };
    let (examples, found) = request.cross_validate(name, args.cv.as_ref())?;
    let held_out = args.predictions.as_deref().unwrap_or(Path::new("the held-out predictions"));
    let ids = &examples.table.ids;
    let predictions = found.predictions(ids, held_out);
    let scores = corsmal_models::validation::held_out(&predictions)?;
    if let Some(path) = &args.predictions {
        output::write(path, &predictions.to_csv()?)?;
    }
    if let Some(caution) = found.caution.filter(|_| args.json || quiet) {
        eprintln!("warning: {caution}");
    }
    if args.json {
        let report = found.to_value(&scores);
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else if !args.quiet {
        println!("features  {}: {} items", examples.table.path.display(), ids.len());
        println!("target    {}, {} classes", found.target, found.labels.len());
        println!("network   {name}");
        println!("held out  {}", found.folds.description);
        if let Some(caution) = found.caution {
            println!("caution   {caution}");
        }
        println!();
        print_folds(&found.result, &[], &found.folds);
        print_held_out(&scores);
    }
    if let Some(folder) = &args.report {
        let held_out = HeldOut {
            table: &examples.table,
            labels: args.dataset.label_file(),
            target: &found.target,
            classes: &found.classes,
            folds: &found.folds,
            result: &found.result,
            predictions: &predictions,
            scores: &scores,
            seeds: &[],
            warnings: found.folds.warnings(&found.classes),
            facts: std::iter::once(Fact::new("Network", name))
                .chain(found.caution.map(|caution| Fact::new("Caution", caution)))
                .collect(),
            quiet,
        };
        held_out.write(folder, None)?;
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(not(feature = "nets"))]
fn validate_network(_: &Args, _: &str) -> Result<ExitCode, Failure> {
    Err(super::nets::absent())
}

fn print_folds(result: &CrossValidation, candidates: &[PipelineSpec], folds: &Folds) {
    let tuned = candidates.len() > 1;
    let heads = ["fold, percent", "train", "test", "accuracy", "weighted F1", "macro F1"];
    let chosen = tuned.then_some("chosen");
    let mut table = TextTable::new(heads.into_iter().chain(chosen)).left(&[6]);
    for (fold, plan) in result.folds.iter().zip(&folds.outer) {
        let s = &fold.scores;
        let scores = [s.accuracy, s.weighted_f1, s.macro_f1].map(percent);
        let counts = [fold.name.clone(), plan.train.len().to_string(), plan.test.len().to_string()];
        let chosen = tuned.then(|| candidates[fold.chosen].describe_among(candidates));
        table.row(counts.into_iter().chain(scores).chain(chosen));
    }
    let spreads = [&result.accuracy, &result.weighted_f1, &result.macro_f1];
    let mut line = |name: &str, value: fn(&Spread) -> f64| {
        let scores = spreads.map(|spread| percent(value(spread)));
        table.row([name.to_string(), String::new(), String::new()].into_iter().chain(scores));
    };
    line("mean", |s| s.mean);
    line("± std", |s| s.std);
    line("95 % CI from", |s| s.low);
    line("95 % CI to", |s| s.high);
    let p = &result.pooled;
    let rows: usize = result.folds.iter().map(|f| f.rows.len()).sum();
    let all = ["all together".into(), String::new(), rows.to_string()];
    table.row(all.into_iter().chain([p.accuracy, p.weighted_f1, p.macro_f1].map(percent)));
    println!("{}", table.text());
}
