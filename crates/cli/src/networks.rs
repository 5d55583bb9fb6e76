//! `train --net` and `cross-validate --net`.

use std::path::Path;
use std::sync::atomic::Ordering;

use corsmal_ccm::dataset::SequenceName;
use corsmal_models::cross_validation::CrossValidation;
use corsmal_models::dataset::LabelledTable;
use corsmal_models::folds::{CvPlan, Folds};
use corsmal_models::labels::Labels;
use corsmal_models::scores::Scores;
use corsmal_models::targets::Classes;
use corsmal_nets::NetError;
use corsmal_nets::cross_validation::{self, Data, Fold};
use corsmal_nets::dataset::Dataset;
use corsmal_nets::fit::{self, Progress, Task};
use corsmal_nets::items::Items;
use corsmal_nets::model::{self, NetModel};
use corsmal_nets::networks::{self, Definition};
use corsmal_nets::recipe::Recipe;
use ndarray::Array2;
use serde_json::{Value, json};

use crate::args::{DatasetArgs, NetworkArgs, PipelineArgs};
use crate::failure::Failure;
use crate::interrupt;

/// What both commands are given.
pub struct Request<'a> {
    /// features and labels
    pub dataset: &'a DatasetArgs,
    /// what --set changes
    pub pipeline: &'a PipelineArgs,
    /// checkpoints
    pub network: &'a NetworkArgs,
    /// nothing but warnings
    pub quiet: bool,
}

/// Labelled items of a network.
struct Loaded {
    definition: &'static Definition,
    recipe: Recipe,
    items: Items,
    table: LabelledTable,
    target: String,
    labels: Labels,
    classes: Classes,
}

/// A validation, in the terms of the classifiers'.
pub struct Validated {
    /// the data
    pub table: LabelledTable,
    /// what was predicted
    pub target: String,
    /// names of the classes
    pub labels: Labels,
    /// the class of each item
    pub classes: Classes,
    /// how items were held out
    pub folds: Folds,
    /// predictions and scores
    pub result: CrossValidation,
    /// name, recipe and histories
    pub report: Value,
}

impl Request<'_> {
    fn load(&self, name: &str) -> Result<Loaded, Failure> {
        let definition = networks::named(name)?;
        if !definition.classifies {
            return Err(Failure::new(format!(
                "{} gives numbers and no classes: it cannot be trained here",
                definition.name
            )));
        }
        let recipe = definition.recipe.with(&self.pipeline.changes()?)?;
        let path = self.dataset.path();
        let Dataset { ids, mut columns, items } = Dataset::read(path, &definition.build(None, 0)?)?;
        columns.extend(named_labels(&columns));
        let mut table = LabelledTable::of_columns(path, ids, columns);
        let target = self.dataset.label(&mut table)?;
        let (labels, classes) = table.classes(&target)?;
        Ok(Loaded { definition, recipe, items, table, target, labels, classes })
    }

    /// Trains on all items.
    pub fn train(&self, name: &str) -> Result<(NetModel, Value), Failure> {
        let Loaded { definition, recipe, items, table, target, labels, classes } =
            self.load(name)?;
        let y = classes.indices().to_vec();
        let groups = self.dataset.groups.as_deref().map(|g| table.column(g)).transpose()?;
        let groups = groups.as_deref();
        let data = Data { items: &items, classes: &y, n_classes: labels.len(), groups };
        let all = Fold { name: "all".into(), train: (0..y.len()).collect(), test: Vec::new() };
        let (train, watched, validation) = cross_validation::watched(data, &all, &recipe)?;
        let task = Task { items: &items, classes: &y, train: &train, watched: &watched };
        let mut network = definition.build(Some(labels.len()), recipe.seed)?;
        let checkpoint = self.folder()?.map(|folder| folder.join("training.safetensors"));
        let history = fit::fit(
            &mut network,
            task,
            &recipe,
            checkpoint.as_deref(),
            |truth, found| weighted_f1(truth, found, labels.len()),
            |progress| self.tell(definition.name, progress),
        )
        .map_err(|e| self.stopped(e))?;
        let summary = json!({
            "network": definition.name,
            "target": target,
            "items": y.len(),
            "labels": labels,
            "recipe": recipe,
            "validation_group": validation,
            "history": history,
        });
        let header = model::Header {
            format: 0,
            network: definition.name.into(),
            labels: labels.names().to_vec(),
            target,
            recipe,
            history,
            feature_config: Value::Null,
            provenance: json!({ "files": self.dataset.provenance()?, "items": y.len() }),
            tool_version: env!("CARGO_PKG_VERSION").into(),
        };
        Ok((NetModel::new(header, network)?, summary))
    }

    /// Holds out parts of the items in turn.
    pub fn cross_validate(&self, name: &str, plan: Option<&CvPlan>) -> Result<Validated, Failure> {
        let Loaded { definition, recipe, items, table, target, labels, classes } =
            self.load(name)?;
        let groups = self.dataset.groups.as_deref();
        let folds = Folds::new(plan, &table, groups, (&labels, &classes), self.pipeline.seed)?;
        for (class, fold) in folds.untrained(&classes) {
            let name = &labels.names()[class];
            eprintln!("warning: fold {fold}: class {name} has no training rows");
        }
        let y = classes.indices().to_vec();
        let data =
            Data { items: &items, classes: &y, n_classes: labels.len(), groups: folds.groups() };
        let outer: Vec<Fold> = folds
            .outer
            .iter()
            .map(|f| Fold { name: f.name.clone(), train: f.train.clone(), test: f.test.clone() })
            .collect();
        let found = cross_validation::cross_validate(
            definition,
            data,
            &outer,
            &recipe,
            self.folder()?,
            |truth, found| weighted_f1(truth, found, labels.len()),
            |fold, progress| self.tell(&fold.name, progress),
        )
        .map_err(|e| self.stopped(e))?;
        let histories: Vec<Value> = found
            .iter()
            .map(
                |f| json!({"fold": f.name, "validation_group": f.validation, "history": f.history}),
            )
            .collect();
        let report = json!({ "network": definition.name, "recipe": recipe, "folds": histories });
        let of_fold = |f: cross_validation::FoldResult| {
            let (rows, columns) = (f.probabilities.len(), labels.len());
            let flat = f.probabilities.into_iter().flatten().collect();
            let proba = Array2::from_shape_vec((rows, columns), flat);
            proba.map(|proba| (f.name, f.test, proba))
        };
        let folds_found = found.into_iter().map(of_fold).collect::<Result<Vec<_>, _>>()?;
        let result = CrossValidation::of_probabilities(folds_found, &classes)?;
        Ok(Validated { table, target, labels, classes, folds, result, report })
    }

    fn folder(&self) -> Result<Option<&Path>, Failure> {
        let Some(folder) = self.network.checkpoints.as_deref() else { return Ok(None) };
        std::fs::create_dir_all(folder)
            .map_err(|e| Failure::new(format!("{}: {e}", folder.display())))?;
        Ok(Some(folder))
    }

    /// A line for each epoch; false once the user asked to stop.
    fn tell(&self, name: &str, progress: Progress<'_>) -> bool {
        if !self.quiet {
            let (done, total) = (progress.epochs.len(), progress.total);
            let left = span(progress.left.as_secs());
            match progress.epochs.last() {
                None => eprintln!("{name}: {total} epochs, about {left}"),
                Some(epoch) => {
                    let score = epoch.score.map(|s| format!(", weighted F1 {:.2}", 100.0 * s));
                    let score = score.unwrap_or_default();
                    eprintln!(
                        "{name}: epoch {done} of {total}: loss {:.4}{score}, {left} left",
                        epoch.loss
                    );
                }
            }
        }
        !interrupt::flag().load(Ordering::SeqCst)
    }

    fn stopped(&self, error: NetError) -> Failure {
        match (&error, &self.network.checkpoints) {
            (NetError::Stopped { .. }, Some(_)) => {
                Failure::new(format!("{error}; the same command goes on from there"))
            }
            (NetError::Stopped { .. }, None) => {
                Failure::new(format!("{error}; --checkpoints would have kept them"))
            }
            _ => error.into(),
        }
    }
}

/// Type and level as numbers, where a column has names of CCM sequences.
fn named_labels(columns: &[(String, Vec<String>)]) -> Vec<(String, Vec<String>)> {
    let has = |name: &str| columns.iter().any(|(column, _)| column == name);
    let names = columns.iter().find(|(column, _)| column == "sequence").and_then(|(_, values)| {
        values.iter().map(|v| SequenceName::parse(v)).collect::<Option<Vec<_>>>()
    });
    let Some(names) = names else { return Vec::new() };
    let mut labels = Vec::new();
    if !has("type") {
        let number = |n: &SequenceName| (n.filling.kind() as u8).to_string();
        labels.push(("type".to_owned(), names.iter().map(number).collect()));
    }
    if !has("level") {
        let number = |n: &SequenceName| (n.filling.level() as u8).to_string();
        labels.push(("level".to_owned(), names.iter().map(number).collect()));
    }
    labels
}

fn weighted_f1(truth: &[usize], found: &[usize], n_classes: usize) -> f64 {
    Scores::new(truth, found, n_classes).map_or(0.0, |s| s.weighted_f1)
}

/// A duration for people.
fn span(seconds: u64) -> String {
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", seconds / 60),
        _ => format!("{:.1} h", seconds as f64 / 3600.0),
    }
}
