//! `corsmal-feat train`: labelled features in, model file out.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_models::cross_validation::{Data, choose};
use corsmal_models::folds::Folds;
use corsmal_models::labels::{Labels, alike, measured};
use corsmal_models::model_file::{Model, ModelHeader};
use linfa::traits::Fit;
use serde_json::{Map, Value, json};

use crate::args::{DatasetArgs, Jobs, NetworkArgs, PipelineArgs};
use crate::failure::Failure;
use crate::paragraphs::wrapped;
use crate::plural::plural;
use crate::publish;

/// Arguments of `train`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat train feats.npz --labels labels.csv --target type --set trees=500 -o type.model
  corsmal-feat train feats.npz --labels folders -o class.model
  corsmal-feat train feats.npz --labels meta.csv --id-column file --target class -o class.model
  corsmal-feat train other.npz --x X --y type --groups container \\
    --classifier svm --standardize --tune C=0.1,1,10 -o type.model

The model file holds classifier, scaling, label names, the feature configuration and the sample
rates and channels of the recordings, so `corsmal-feat classify` needs nothing else.
`corsmal-feat classifiers` explains the classifiers and their parameters.

Exit codes: 0 fine, 2 could not run, 130 interrupted.")]
pub struct Args {
    #[command(flatten)]
    dataset: DatasetArgs,
    #[command(flatten)]
    pipeline: PipelineArgs,
    #[command(flatten)]
    network: NetworkArgs,
    /// Model file to write.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing model file.
    #[arg(long)]
    overwrite: bool,
    /// Print what was trained as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    jobs: Jobs,
    /// Print only warnings and errors.
    #[arg(long, short)]
    quiet: bool,
}

/// Trains on all rows and writes the model.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    args.jobs.pool()?.install(|| train(&args))
}

/// All files that are read.
fn files(args: &Args) -> Vec<PathBuf> {
    args.dataset.files().into_iter().chain(args.network.weights.clone()).collect()
}

fn train(args: &Args) -> Result<ExitCode, Failure> {
    publish::check(&args.out, args.overwrite)?;
    publish::spare(&args.out, files(args))?;
    if let Some(name) = &args.network.net {
        return train_network(args, name);
    }
    let candidates = args.pipeline.candidates()?;
    let (table, target) = args.dataset.load()?;
    let (labels, classes) = table.classes(&target)?;
    for warning in alike(&labels).into_iter().chain(measured(&labels, classes.len())) {
        eprintln!("warning: {warning}");
    }
    if let Some(warning) = corsmal_models::dominance(&candidates, &table) {
        eprintln!("warning: {warning}");
    }
    let rows_of = counts(&labels, &classes.indices().to_vec());
    for (name, rows) in &rows_of {
        if *rows == 1 {
            let text = format!("class {name} of {target} has 1 row: at least 2 are needed");
            return Err(Failure::new(text));
        }
    }
    let groups = args.dataset.groups.as_deref().map(|g| table.column(g)).transpose()?;
    let dataset = table.dataset(classes.clone());
    let mut chosen = 0;
    let mut choice = Value::Null;
    if candidates.len() == 1 && groups.is_some() {
        eprintln!(
            "warning: --groups affects only --tune, whose inner folds keep groups whole; all rows \
             are used for training"
        );
    }
    if candidates.len() > 1 {
        let (seed, named) = (args.pipeline.seed(), args.dataset.groups.as_deref());
        let folds = Folds::for_choice(&table, named, (&labels, &classes), seed)?;
        let data = Data { dataset: &dataset, merge: None };
        let all: Vec<usize> = (0..classes.len()).collect();
        let (best, scores) = choose(&data, &all, &candidates, |rows| folds.inner(rows, &classes))?;
        chosen = best;
        choice = json!({ "candidates": candidates, "weighted_f1": scores });
    }
    let spec = candidates[chosen].clone();
    let fitted = spec.fit(&dataset)?;
    let provenance = json!({
        "files": args.dataset.provenance()?,
        "rows": classes.len(),
        "rows_per_class": rows_of.iter().map(|(n, r)| (n.clone(), (*r).into())).collect::<Map<_, _>>(),
        "groups": groups.map(|g| Labels::of(&g).0),
        "seed": args.pipeline.seed(),
        "choice": choice,
    });
    let trained_on = table.trained_on();
    let header = ModelHeader {
        pipeline: spec.clone(),
        labels: labels.clone(),
        target: target.clone(),
        feature_names: table.feature_names.clone(),
        feature_config: table.config.clone(),
        feature_config_hash: table.config_hash.clone(),
        provenance,
        trained_on: trained_on.clone(),
        tool_version: env!("CARGO_PKG_VERSION").to_string(),
    };
    Model::new(header, fitted)?.save(&args.out)?;
    let out = args.out.display();
    if args.json {
        let report = json!({
            "model": out.to_string(),
            "pipeline": spec,
            "target": target,
            "rows": classes.len(),
            "n_features": table.x.ncols(),
            "rows_per_class": rows_of.iter().map(|(n, r)| (n.clone(), (*r).into())).collect::<Map<_, _>>(),
            "trained_on": trained_on,
        });
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else if !args.quiet {
        let classes_text: Vec<_> =
            rows_of.iter().map(|(name, rows)| format!("{name} ({rows})")).collect();
        println!("{out}: {}", spec.describe());
        let learned = format!(
            "{}, {}, {target}: {}",
            plural(classes.len(), "row"),
            plural(table.x.ncols(), "feature"),
            classes_text.join(", ")
        );
        println!("{}", wrapped(&learned, ""));
        let apply = if table.config.is_null() { "--features OTHER.npz" } else { "YOUR_RECORDINGS" };
        println!(
            "next: corsmal-feat classify --model {out} {apply} -o predictions.csv\n      \
             corsmal-feat cross-validate with the same arguments but -o estimates how good it is"
        );
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(feature = "nets")]
fn train_network(args: &Args, name: &str) -> Result<ExitCode, Failure> {
    use corsmal_systems::training::Trained;

    let Args { dataset, pipeline, network, quiet, jobs, .. } = args;
    let (jobs, quiet) = (jobs.count(), *quiet);
    let request = crate::networks::Request { dataset, pipeline, network, jobs, quiet };
    let Trained { model, items, validation_group } = request.train(name)?;
    let bytes = model.to_bytes().map_err(Failure::new)?;
    corsmal_files::draft::write(&args.out, &bytes)?;
    let (out, header) = (args.out.display(), &model.header);
    if args.json {
        let summary = json!({
            "network": header.network,
            "target": header.target,
            "items": items,
            "labels": header.labels,
            "recipe": header.recipe,
            "validation_group": validation_group.map(|(_, group)| group),
            "history": header.history,
        });
        println!("{}", serde_json::to_string_pretty(&summary)?);
    } else if !args.quiet {
        let (name, target) = (&header.network, &header.target);
        println!("{out}: {name}, {} numbers", model.network.parameters().count());
        let by = validation_group.map_or(String::new(), |(column, group)| {
            format!(", the best on {column} {group}, which was not trained on")
        });
        let kept = header.history.kept + 1;
        println!("{target}: {}; epoch {kept} kept{by}", header.labels.join(", "));
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(not(feature = "nets"))]
fn train_network(_: &Args, _: &str) -> Result<ExitCode, Failure> {
    Err(super::nets::absent())
}

fn counts(labels: &Labels, y: &[usize]) -> Vec<(String, usize)> {
    let rows = |class: usize| y.iter().filter(|&&c| c == class).count();
    labels.names().iter().enumerate().map(|(class, name)| (name.clone(), rows(class))).collect()
}
