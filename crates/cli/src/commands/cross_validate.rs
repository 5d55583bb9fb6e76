//! `corsmal-feat cross-validate`: scores on rows that were not trained on.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_models::cross_validation::{
    CrossValidation, Data, cross_validate, nested_cross_validate,
};
use corsmal_models::labels::Labels;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::scores::Scores;
use corsmal_models::spread::Spread;
use corsmal_models::targets::Classes;
use linfa::DatasetBase;
use serde_json::json;

use crate::dataset_table::{DatasetArgs, DatasetTable};
use crate::failure::Failure;
use crate::folds::{CvPlan, Folds};
use crate::pipeline::{self, PipelineArgs};
use crate::publish;
use corsmal_files::draft;

/// Arguments of `cross-validate`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat cross-validate --features feats.npz --labels labels.csv --target type \\
    --groups container --classifier rf --set trees=500
  corsmal-feat cross-validate --features a34f_train.npz --target level --groups container \\
    --cv lists=1,4,7/2,5,8/3,6,9 --classifier svm --standardize --tune C=1,10 --tune gamma=scale,0.01

With --tune the parameters are chosen anew in every fold, on inner folds of its training rows.
`compare-predictions` tests whether the --predictions of two runs differ.")]
pub struct Args {
    #[command(flatten)]
    dataset: DatasetArgs,
    #[command(flatten)]
    pipeline: PipelineArgs,
    /// What is held out: group=COLUMN (each group once), k=N folds (of whole groups with --groups,
    /// else stratified), lists=1,4,7/2,5,8/3,6,9 of --groups, or fold=COLUMN. Default: each group
    /// of --groups, or of a label column container or group, or k=5.
    #[arg(long, value_name = "PLAN")]
    cv: Option<CvPlan>,
    /// Print everything as JSON instead of tables.
    #[arg(long)]
    json: bool,
    /// Write the predictions of the held-out rows, CSV.
    #[arg(long, value_name = "CSV")]
    predictions: Option<PathBuf>,
    /// Replace an existing file of predictions.
    #[arg(long)]
    overwrite: bool,
}

/// Validates and prints.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    if let Some(path) = &args.predictions {
        publish::check(path, args.overwrite)?;
    }
    let candidates = args.pipeline.candidates()?;
    let table = args.dataset.load()?;
    let (labels, y) = table.classes(&args.dataset.target)?;
    let groups = args.dataset.groups.as_deref();
    let folds = Folds::new(args.cv.as_ref(), &table, groups, (&labels, &y), args.pipeline.seed)?;
    for (class, fold) in folds.untrained(&y) {
        eprintln!("warning: fold {fold}: class {} has no training rows", labels.names()[class]);
    }
    let dataset = DatasetBase::new(table.x.view(), Classes::new(y.clone(), labels.len())?);
    let data = Data { dataset: &dataset, merge: None };
    let result = match candidates.as_slice() {
        [only] => cross_validate(&data, &folds.outer, only)?,
        _ => nested_cross_validate(&data, &folds.outer, &candidates, |rows| folds.inner(rows, &y))?,
    };
    if let Some(path) = &args.predictions {
        draft::write(path, &predictions(&table, &labels, &y, &result)?)?;
    }
    if args.json {
        let report = json!({
            "features": table.path.display().to_string(),
            "target": args.dataset.target,
            "labels": labels,
            "rows": y.len(),
            "n_features": table.x.ncols(),
            "folds_by": folds.description,
            "seed": args.pipeline.seed,
            "candidates": candidates,
            "result": result,
        });
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print_head(&table, &args.dataset.target, &labels, &candidates, &folds);
        print_folds(&result, &candidates, &folds);
        print_classes(&result.pooled, &labels);
    }
    Ok(ExitCode::SUCCESS)
}

fn print_head(
    table: &DatasetTable,
    target: &str,
    labels: &Labels,
    candidates: &[PipelineSpec],
    folds: &Folds,
) {
    let (rows, features) = table.x.dim();
    println!("features  {}: {rows} rows x {features} features", table.path.display());
    println!("target    {target}, {} classes", labels.len());
    match candidates {
        [only] => println!("pipeline  {}", pipeline::describe(only)),
        many => println!("pipeline  chosen in every fold among {}", many.len()),
    }
    println!("held out  {}\n", folds.description);
}

fn print_folds(result: &CrossValidation, candidates: &[PipelineSpec], folds: &Folds) {
    let names = result.folds.iter().map(|f| f.name.chars().count());
    let width = names.max().unwrap_or(0).max(13);
    println!(
        "{:width$} {:>6} {:>6} {:>9} {:>12} {:>9}",
        "fold, percent", "train", "test", "accuracy", "weighted F1", "macro F1"
    );
    for (fold, plan) in result.folds.iter().zip(&folds.outer) {
        let (s, percent) = (&fold.scores, 100.0);
        print!(
            "{:width$} {:>6} {:>6} {:>9.2} {:>12.2} {:>9.2}",
            fold.name,
            plan.train.len(),
            plan.test.len(),
            s.accuracy * percent,
            s.weighted_f1 * percent,
            s.macro_f1 * percent
        );
        match candidates {
            [_] => println!(),
            many => println!("  {}", pipeline::describe(&many[fold.chosen])),
        }
    }
    let spreads = [&result.accuracy, &result.weighted_f1, &result.macro_f1];
    let line = |name: &str, value: fn(&Spread) -> f64| {
        let v: Vec<f64> = spreads.iter().map(|s| value(s) * 100.0).collect();
        println!("{name:width$} {:>13} {:>9.2} {:>12.2} {:>9.2}", "", v[0], v[1], v[2]);
    };
    line("mean", |s| s.mean);
    line("± std", |s| s.std);
    line("95 % CI from", |s| s.low);
    line("95 % CI to", |s| s.high);
    let p = &result.pooled;
    let rows: usize = result.folds.iter().map(|f| f.rows.len()).sum();
    println!(
        "{:width$} {:>6} {:>6} {:>9.2} {:>12.2} {:>9.2}\n",
        "all together",
        "",
        rows,
        p.accuracy * 100.0,
        p.weighted_f1 * 100.0,
        p.macro_f1 * 100.0
    );
}

fn print_classes(scores: &Scores, labels: &Labels) {
    let names = labels.names();
    let width = names.iter().map(|n| n.chars().count()).max().unwrap_or(0).max(15);
    println!(
        "{:width$} {:>9} {:>9} {:>9} {:>6}",
        "class, percent", "precision", "recall", "F1", "rows"
    );
    for (name, c) in names.iter().zip(&scores.classes) {
        println!(
            "{name:width$} {:>9.2} {:>9.2} {:>9.2} {:>6}",
            c.precision * 100.0,
            c.recall * 100.0,
            c.f1 * 100.0,
            c.support
        );
    }
    let cell = names.iter().map(|n| n.chars().count()).max().unwrap_or(0).max(6);
    print!("\n{:width$}", "true, predicted");
    names.iter().for_each(|name| print!(" {name:>cell$}"));
    println!();
    for (name, row) in names.iter().zip(&scores.confusion) {
        print!("{name:width$}");
        row.iter().for_each(|count| print!(" {count:>cell$}"));
        println!();
    }
}

/// A line for each held-out row, in the order of the table.
fn predictions(
    table: &DatasetTable,
    labels: &Labels,
    y: &[usize],
    result: &CrossValidation,
) -> Result<Vec<u8>, Failure> {
    let names = labels.names();
    let mut lines: Vec<(usize, Vec<String>)> = Vec::new();
    for fold in &result.folds {
        for (at, (&row, &class)) in fold.rows.iter().zip(&fold.predicted).enumerate() {
            let mut line = vec![table.ids[row].clone(), fold.name.clone()];
            line.extend([names[y[row]].clone(), names[class].clone()]);
            line.extend((0..names.len()).map(|c| match &fold.proba {
                Some(proba) => proba[[at, c]].to_string(),
                None => String::new(),
            }));
            lines.push((row, line));
        }
    }
    lines.sort_by_key(|(row, _)| *row);
    let mut writer = csv::Writer::from_writer(Vec::new());
    let columns = names.iter().map(|label| format!("p_{label}"));
    let fixed = ["id", "fold", "true", "predicted"].into_iter().map(String::from);
    writer.write_record(fixed.chain(columns))?;
    for (_, line) in &lines {
        writer.write_record(line)?;
    }
    writer.into_inner().map_err(|e| Failure::new(e.to_string()))
}
