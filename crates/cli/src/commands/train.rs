//! `corsmal-feat train`: labelled features in, model file out.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_models::cross_validation::{Data, choose};
use corsmal_models::labels::Labels;
use corsmal_models::model_file::{Model, ModelHeader};
use corsmal_models::targets::Classes;
use linfa::DatasetBase;
use serde_json::{Map, Value, json};

use crate::dataset_table::DatasetArgs;
use crate::failure::Failure;
use crate::folds::Folds;
use crate::pipeline::{self, PipelineArgs};
use crate::publish;
use corsmal_files::draft;

/// Arguments of `train`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat train --features feats.npz --labels labels.csv --target type \\
    --classifier rf --set trees=500 --standardize --out type.model
  corsmal-feat train --features other.npz --x X --y type --groups container \\
    --classifier svm --standardize --tune C=0.1,1,10 --out type.model

The model file holds classifier, scaling, label names and the feature configuration, so
`corsmal-feat classify` needs nothing else. Classifiers are described in docs/classifiers.md.")]
pub struct Args {
    #[command(flatten)]
    dataset: DatasetArgs,
    #[command(flatten)]
    pipeline: PipelineArgs,
    /// Model file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing model file.
    #[arg(long)]
    overwrite: bool,
    /// Print nothing but warnings.
    #[arg(long, short)]
    quiet: bool,
}

/// Trains on all rows and writes the model.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    publish::check(&args.out, args.overwrite)?;
    let candidates = args.pipeline.candidates()?;
    let table = args.dataset.load()?;
    let target = args.dataset.target.as_str();
    let (labels, y) = table.classes(target)?;
    let rows_of = counts(&labels, &y);
    for (name, rows) in &rows_of {
        if *rows == 1 {
            let text = format!("class {name} of {target} has 1 row: at least 2 are needed");
            return Err(Failure::new(text));
        }
    }
    let groups = args.dataset.groups.as_deref().map(|g| table.column(g)).transpose()?;
    let mut chosen = 0;
    let mut choice = Value::Null;
    if candidates.len() > 1 {
        let (seed, named) = (args.pipeline.seed, args.dataset.groups.as_deref());
        let folds = Folds::new(None, &table, named, (&labels, &y), seed)?;
        let dataset = DatasetBase::new(table.x.view(), Classes::new(y.clone(), labels.len())?);
        let data = Data { dataset: &dataset, merge: None };
        let all: Vec<usize> = (0..y.len()).collect();
        let (best, scores) = choose(&data, &all, &candidates, |rows| folds.inner(rows, &y))?;
        chosen = best;
        choice = json!({ "candidates": candidates, "weighted_f1": scores });
    }
    let spec = candidates[chosen].clone();
    let fitted = spec.train(table.x.view(), &y, labels.len())?;
    let provenance = json!({
        "files": args.dataset.provenance()?,
        "rows": y.len(),
        "rows_per_class": rows_of.iter().map(|(n, r)| (n.clone(), (*r).into())).collect::<Map<_, _>>(),
        "groups": groups.map(|g| Labels::of(&g).0),
        "seed": args.pipeline.seed,
        "choice": choice,
    });
    let header = ModelHeader {
        pipeline: spec.clone(),
        labels: labels.clone(),
        target: target.to_string(),
        feature_names: table.feature_names,
        feature_config: table.config,
        feature_config_hash: table.config_hash,
        provenance,
        tool_version: env!("CARGO_PKG_VERSION").to_string(),
    };
    let bytes = Model::new(header, fitted)?.to_bytes()?;
    draft::write(&args.out, &bytes)?;
    if !args.quiet {
        let classes: Vec<_> =
            rows_of.iter().map(|(name, rows)| format!("{name} ({rows})")).collect();
        println!("{}: {}", args.out.display(), pipeline::describe(&spec));
        println!(
            "{} rows, {} features, {target}: {}",
            y.len(),
            table.x.ncols(),
            classes.join(", ")
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn counts(labels: &Labels, y: &[usize]) -> Vec<(String, usize)> {
    let rows = |class: usize| y.iter().filter(|&&c| c == class).count();
    labels.names().iter().enumerate().map(|(class, name)| (name.clone(), rows(class))).collect()
}
