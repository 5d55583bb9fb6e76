//! `train --net` and `cross-validate --net`.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use corsmal_ccm::CcmError;
use corsmal_ccm::dataset::SequenceName;
use corsmal_extract::config::Config;
use corsmal_extract::inputs;
use corsmal_files::format::Content;
use corsmal_models::cross_validation::CrossValidation;
use corsmal_models::dataset::LabelledTable;
use corsmal_models::folds::{CvPlan, Folds};
use corsmal_models::labels::Labels;
use corsmal_models::model_file::TrainedOn;
use corsmal_models::scores::Scores;
use corsmal_models::splits as models;
use corsmal_models::targets::Classes;
use corsmal_nets::NetError;
use corsmal_nets::cross_validation::{self, Data, Fold};
use corsmal_nets::dataset::Dataset;
use corsmal_nets::fit::{self, Progress, Task};
use corsmal_nets::front_end::{FrontEnd, Item};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::model::{self, NetModel};
use corsmal_nets::network::Network;
use corsmal_nets::networks::{self, Definition};
use corsmal_nets::recipe::{Recipe, Select};
use corsmal_systems::recordings;
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
    /// recordings that are extracted at a time
    pub jobs: usize,
    /// nothing but warnings
    pub quiet: bool,
}

/// Labelled items of a network.
struct Loaded {
    definition: &'static Definition,
    recipe: Recipe,
    items: Items,
    /// the row of each item: a recording may be several windows
    row_of: Vec<usize>,
    /// features and formats of recordings that the items were made of
    made: Made,
    /// a row for each recording, or each item of a file
    table: LabelledTable,
    target: String,
    labels: Labels,
    classes: Classes,
}

/// How items were made of recordings; nothing where they came from a file.
#[derive(Default)]
struct Made {
    config: Option<Config>,
    trained_on: Option<TrainedOn>,
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
    /// what must be said beside the scores
    pub caution: Option<&'static str>,
}

impl Request<'_> {
    fn load(&self, name: &str) -> Result<Loaded, Failure> {
        let definition = networks::classifier(name)?;
        let recipe = definition.recipe_with(&self.pipeline.changes()?)?;
        let path = self.dataset.path();
        let network = definition.build(None, 0)?;
        let (mut table, items, row_of, made) = match is_npz(path) {
            true => {
                let names = self.dataset.members.names();
                let read = Dataset::read_members(path, &network, &names.x, names.ids.as_deref());
                let Dataset { ids, mut columns, items } = read?;
                columns.extend(named_labels(&columns));
                let row_of = (0..ids.len()).collect();
                (LabelledTable::of_columns(path, ids, columns), items, row_of, Made::default())
            }
            false => self.of_recordings(definition, &network)?,
        };
        let target = self.dataset.label(&mut table)?;
        let (labels, classes) = table.classes(&target)?;
        Ok(Loaded { definition, recipe, items, row_of, made, table, target, labels, classes })
    }

    /// Recordings through the network's front end.
    fn of_recordings(
        &self,
        definition: &Definition,
        network: &Network,
    ) -> Result<(LabelledTable, Items, Vec<usize>, Made), Failure> {
        let path = self.dataset.path();
        self.dataset.members.refuse()?;
        let front_end = front_end(definition)?;
        let collected = inputs::collect(&[path])?;
        if let Some(skipped) = collected.warning() {
            eprintln!("warning: {skipped}");
        }
        let config = recordings::configuration(&front_end)?;
        let stop = interrupt::flag();
        let shared = Arc::new(config.clone());
        let mut kept = match recordings::temporary(&collected.inputs, &shared, self.jobs, stop) {
            Err(e @ CcmError::Interrupted) => return Err(Failure::interrupted(e.to_string())),
            kept => kept?,
        };
        let outcomes = std::mem::take(&mut kept.outcomes);
        let (mut heard, mut ids, mut row_of) = (Vec::new(), Vec::new(), Vec::new());
        let mut items: Vec<Item> = Vec::new();
        let mut columns: Vec<(String, Vec<String>)> = Vec::new();
        for (input, outcome) in collected.inputs.iter().zip(outcomes) {
            let found = match outcome.status.has_features() {
                true => {
                    front_end.items(network, kept.tensor(&input.id)?).map_err(|e| e.to_string())
                }
                false => Err(format!("{}: {}", outcome.status, outcome.reason)),
            };
            let found = match found {
                Ok(found) => found,
                Err(reason) => {
                    eprintln!("warning: {}: {reason}: not trained on", input.id);
                    continue;
                }
            };
            if columns.is_empty() {
                columns = input.labels.iter().map(|(n, _)| (n.clone(), Vec::new())).collect();
            }
            columns.iter_mut().zip(&input.labels).for_each(|((_, c), (_, v))| c.push(v.clone()));
            row_of.extend(std::iter::repeat_n(ids.len(), found.len()));
            items.extend(found);
            ids.push(input.id.clone());
            heard.push(outcome);
        }
        if ids.is_empty() {
            let place = path.display();
            return Err(Failure::new(format!(
                "{place}: no recording has features: nothing to train on"
            )));
        }
        let trained_on = TrainedOn::of(heard.iter().map(|o| (o.sample_rate, o.channels)));
        let mut table = LabelledTable::of_columns(path, ids, columns);
        table.outcomes = heard;
        let column = Column::of(items.iter().map(|item| item.values.as_slice()));
        let made = Made { config: Some(config), trained_on };
        Ok((table, Items { columns: vec![column] }, row_of, made))
    }

    /// Trains on all items.
    pub fn train(&self, name: &str) -> Result<(NetModel, Value), Failure> {
        let Loaded { definition, recipe, items, row_of, made, table, target, labels, classes } =
            self.load(name)?;
        let y: Vec<usize> = row_of.iter().map(|&row| classes.indices()[row]).collect();
        let groups = self.dataset.groups.as_deref().map(|g| table.column(g)).transpose()?;
        let groups = groups.map(|g| of_items(&g, &row_of));
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
            feature_config: made.config.map_or(Value::Null, |config| config.to_value()),
            provenance: json!({
                "files": if is_npz(self.dataset.path()) { self.dataset.provenance()? } else { Value::Null },
                "recordings": if is_npz(self.dataset.path()) { Value::Null } else { table.ids.len().into() },
                "items": y.len(),
                "trained_on": made.trained_on,
            }),
            tool_version: env!("CARGO_PKG_VERSION").into(),
        };
        Ok((NetModel::new(header, network)?, summary))
    }

    /// Holds out parts of the items in turn.
    pub fn cross_validate(&self, name: &str, plan: Option<&CvPlan>) -> Result<Validated, Failure> {
        let Loaded { definition, recipe, items, row_of, table, target, labels, classes, .. } =
            self.load(name)?;
        let groups = self.dataset.groups.as_deref();
        let folds = Folds::new(plan, &table, groups, (&labels, &classes), self.pipeline.seed())?;
        for (class, fold) in folds.untrained(&classes) {
            let name = &labels.names()[class];
            eprintln!("warning: fold {fold}: class {name} has no training rows");
        }
        let y: Vec<usize> = row_of.iter().map(|&row| classes.indices()[row]).collect();
        let groups = folds.groups().map(|groups| of_items(groups, &row_of));
        let groups = groups.as_deref();
        let data = Data { items: &items, classes: &y, n_classes: labels.len(), groups };
        let mut items_of: Vec<Vec<usize>> = vec![Vec::new(); table.ids.len()];
        row_of.iter().enumerate().for_each(|(item, &row)| items_of[row].push(item));
        let of_rows = |rows: &[usize]| -> Vec<usize> {
            rows.iter().flat_map(|&row| items_of[row].iter().copied()).collect()
        };
        let outer: Vec<Fold> = folds
            .outer
            .iter()
            .map(|f| Fold {
                name: f.name.clone(),
                train: of_rows(&f.train),
                test: of_rows(&f.test),
            })
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
        // A recording of several windows has their mean.
        let of_fold = |(f, fold): (cross_validation::FoldResult, &models::Fold)| {
            let mut proba = Array2::zeros((fold.test.len(), labels.len()));
            let mut windows = f.probabilities.iter();
            for (mut mean, &row) in proba.rows_mut().into_iter().zip(&fold.test) {
                for window in windows.by_ref().take(items_of[row].len()) {
                    mean.iter_mut().zip(window).for_each(|(sum, p)| *sum += p);
                }
                mean /= items_of[row].len() as f64;
            }
            (f.name, fold.test.clone(), proba)
        };
        let folds_found: Vec<_> = found.into_iter().zip(&folds.outer).map(of_fold).collect();
        let result = CrossValidation::of_probabilities(folds_found, &classes)?;
        let caution = (recipe.select == Select::Published).then_some(
            "scores are too good: with select=published, the held-out fold also chose the epoch",
        );
        Ok(Validated { table, target, labels, classes, folds, result, report, caution })
    }

    fn folder(&self) -> Result<Option<&Path>, Failure> {
        let Some(folder) = self.network.checkpoints.as_deref() else { return Ok(None) };
        std::fs::create_dir_all(folder)
            .map_err(|e| Failure::new(format!("{}: {e}", folder.display())))?;
        Ok(Some(folder))
    }

    /// A line for each epoch; before any step, false once the user asked to stop.
    fn tell(&self, name: &str, progress: Progress<'_>) -> bool {
        if !self.quiet && progress.step.is_none() {
            let (done, total) = (progress.epochs.len(), progress.total);
            let left = span(progress.left.as_secs());
            match progress.epochs.last() {
                None => {
                    let mib = progress.memory.div_ceil(1 << 20);
                    let epochs = if total == 1 { "epoch" } else { "epochs" };
                    eprintln!("{name}: {total} {epochs}, about {left}, {mib} MiB of memory");
                }
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
                Failure::interrupted(format!("{error}; run the same command again to continue"))
            }
            (NetError::Stopped { .. }, None) => Failure::interrupted(format!(
                "{error}; with --checkpoints they would have been kept"
            )),
            _ => error.into(),
        }
    }
}

/// Whether a path names a file of a network's inputs, and not recordings; a stream is not looked into.
fn is_npz(path: &Path) -> bool {
    path.is_file() && Content::of(path).is_ok_and(|content| content == Content::Npz)
}

/// How a network's input comes from recordings.
///
/// # Errors
/// What it takes instead.
pub fn front_end(definition: &Definition) -> Result<FrontEnd, Failure> {
    definition.front_end.ok_or_else(|| {
        Failure::new(format!(
            "{} takes {}, not recordings: give an .npz of these",
            definition.name, definition.takes
        ))
    })
}

/// The value of each item's row.
fn of_items(values: &[String], row_of: &[usize]) -> Vec<String> {
    row_of.iter().map(|&row| values[row].clone()).collect()
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
