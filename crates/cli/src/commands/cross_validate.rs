//! `corsmal-feat cross-validate`: scores on rows that were not trained on.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use corsmal_files::draft;
use corsmal_models::cross_validation::CrossValidation;
use corsmal_models::folds::{CvPlan, Folds};
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::scores::{ScoreReport, Scoring};
use corsmal_models::spread::Spread;
use corsmal_models::validation::validate;

use super::score::print_classes;
use crate::args::{DatasetArgs, Jobs, NetworkArgs, PipelineArgs};
use crate::failure::Failure;
use crate::publish;
use crate::text_table::{TextTable, percent};

/// Arguments of `cross-validate`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat cross-validate feats.npz --labels labels.csv --target type \\
    --groups container --classifier rf --set trees=500
  corsmal-feat cross-validate feats.npz --labels folders --cv 5
  corsmal-feat cross-validate a34f_train.npz --target level --groups container \\
    --cv lists=1,4,7/2,5,8/3,6,9 --classifier svm --standardize --tune C=1,10 --tune gamma=scale,0.01

With --tune the parameters are chosen anew in every fold, on inner folds of its training rows.
`score` says more of the --predictions, `compare-predictions` tests whether those of two runs differ.

Exit codes: 0 fine, 2 could not run.")]
pub struct Args {
    #[command(flatten)]
    dataset: DatasetArgs,
    #[command(flatten)]
    pipeline: PipelineArgs,
    #[command(flatten)]
    network: NetworkArgs,
    /// What is held out: N or k=N folds (of whole groups with --groups, else stratified),
    /// group=COLUMN (each group once), lists=1,4,7/2,5,8/3,6,9 of --groups, or fold=COLUMN. Default:
    /// each group of --groups, or of a label column container or group, or 5 folds.
    #[arg(long, value_name = "PLAN")]
    cv: Option<CvPlan>,
    /// Print everything as JSON instead of tables.
    #[arg(long)]
    json: bool,
    /// Write the predictions of the held-out rows, CSV.
    #[arg(long, short = 'o', value_name = "CSV")]
    predictions: Option<PathBuf>,
    /// Replace an existing file of predictions.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    jobs: Jobs,
    /// Print nothing but warnings.
    #[arg(long, short)]
    quiet: bool,
}

/// Validates and prints.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    args.jobs.pool()?.install(|| cross_validate(&args))
}

fn cross_validate(args: &Args) -> Result<ExitCode, Failure> {
    if let Some(path) = &args.predictions {
        publish::check(path, args.overwrite)?;
    }
    if let Some(name) = &args.network.net {
        return validate_network(args, name);
    }
    let candidates = args.pipeline.candidates()?;
    let (table, target) = args.dataset.load()?;
    let groups = args.dataset.groups.as_deref();
    let validation =
        validate(&table, &target, candidates, (args.cv.as_ref(), groups), args.pipeline.seed)?;
    for warning in &validation.warnings {
        eprintln!("warning: {warning}");
    }
    let held_out = Path::new("the held-out predictions");
    let predictions =
        validation.predictions(&table.ids, args.predictions.as_deref().unwrap_or(held_out));
    if let Some(path) = &args.predictions {
        draft::write(path, &predictions.to_csv()?)?;
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&validation)?);
        return Ok(ExitCode::SUCCESS);
    }
    if args.quiet {
        return Ok(ExitCode::SUCCESS);
    }
    println!(
        "features  {}: {} rows x {} features",
        table.path.display(),
        validation.rows,
        validation.n_features
    );
    println!("target    {target}, {} classes", validation.labels.len());
    match validation.candidates.as_slice() {
        [only] => println!("pipeline  {}", only.describe()),
        many => println!("pipeline  chosen in every fold among {}", many.len()),
    }
    println!("held out  {}\n", validation.folds_by);
    print_folds(&validation.result, &validation.candidates, &validation.folds);
    if let ScoreReport::Classes(report) = predictions.score(&Scoring::default())? {
        println!();
        print_classes(&report);
    }
    if let Some(path) = &args.predictions {
        println!("\nnext: corsmal-feat score {}", path.display());
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(feature = "nets")]
fn validate_network(args: &Args, name: &str) -> Result<ExitCode, Failure> {
    let Args { dataset, pipeline, network, quiet, .. } = args;
    let request = crate::networks::Request { dataset, pipeline, network, quiet: *quiet };
    let found = request.cross_validate(name, args.cv.as_ref())?;
    let held_out = args.predictions.as_deref().unwrap_or(Path::new("the held-out predictions"));
    let ids = &found.table.ids;
    let predictions = found.result.predictions(ids, &found.labels, &found.classes, held_out);
    if let Some(path) = &args.predictions {
        draft::write(path, &predictions.to_csv()?)?;
    }
    if args.json {
        let report = serde_json::json!({
            "target": found.target,
            "labels": found.labels,
            "folds_by": found.folds.description,
            "training": found.report,
            "result": found.result,
        });
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else if !quiet {
        println!("features  {}: {} items", found.table.path.display(), ids.len());
        println!("target    {}, {} classes", found.target, found.labels.len());
        println!("network   {name}");
        println!("held out  {}\n", found.folds.description);
        print_folds(&found.result, &[], &found.folds);
        if let ScoreReport::Classes(report) = predictions.score(&Scoring::default())? {
            println!();
            print_classes(&report);
        }
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
        let chosen = tuned.then(|| candidates[fold.chosen].describe());
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
