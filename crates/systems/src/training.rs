//! Networks trained on labelled items, and validated on items that they were not trained on.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use corsmal_models::argmax;
use corsmal_models::cross_validation::CrossValidation;
use corsmal_models::cv_plan::CvPlan;
use corsmal_models::folds::Folds;
use corsmal_models::fusion::WindowVotes;
use corsmal_models::groups;
use corsmal_models::labels::Labels;
use corsmal_models::predictions::PredictionTable;
use corsmal_models::scores::{ClassReport, Scores};
use corsmal_models::targets::Classes;
use corsmal_nets::NetError;
use corsmal_nets::cross_validation::{self, Data, FoldItems};
use corsmal_nets::device::Device;
use corsmal_nets::fit::{self, Progress, Task};
use corsmal_nets::model::{Header, NetModel};
use corsmal_nets::network::Network;
use corsmal_nets::networks::Definition;
use corsmal_nets::recipe::{Recipe, Select};
use corsmal_nets::weights::{self, State};
use ndarray::Array2;
use serde_json::{Value, json};

use crate::error::{Result, SystemError};
use crate::examples::Examples;

/// What is learned, and how.
#[derive(Clone, Debug)]
pub struct Training<'a> {
    /// label column to learn
    pub target: &'a str,
    /// label column of groups that must not be split; otherwise container or group, where there is one
    pub groups: Option<&'a str>,
    /// how the network is trained
    pub recipe: Recipe,
    /// folder that keeps the training after each epoch; the next one continues from there
    pub checkpoints: Option<&'a Path>,
    /// what it begins with instead of random numbers
    pub weights: Option<&'a Weights>,
    /// where the network computes
    pub device: Device,
}

/// Weights that a training begins with; see [`corsmal_nets::network::Network::begin_with`].
#[derive(Clone, Debug)]
pub struct Weights {
    path: PathBuf,
    identity: String,
    state: State,
    /// the classes of its outputs, where it is a trained model
    labels: Option<Vec<String>>,
}

impl Weights {
    /// Reads a file (`.pth`, `.npz`, `.safetensors`).
    ///
    /// # Errors
    /// A file that cannot be read or holds no weights.
    pub fn read(path: &Path) -> Result<Self> {
        let identity = corsmal_files::identity::of_file(path)
            .map_err(|source| SystemError::Io { path: path.into(), source })?;
        let labels = NetModel::load(path).ok().map(|model| model.header.labels);
        Ok(Self { path: path.into(), identity, state: weights::read(path)?, labels })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The numbers for these classes: outputs of a model for other ones start anew.
    fn state_for(&self, definition: &Definition, labels: &Labels) -> Cow<'_, State> {
        match &self.labels {
            Some(own) if own != labels.names() => {
                Cow::Owned(definition.without_outputs(&self.state))
            }
            _ => Cow::Borrowed(&self.state),
        }
    }

    /// Lets the trainings of a network begin with them.
    ///
    /// # Errors
    /// [`SystemError::OtherWeights`] for those of another network.
    pub(crate) fn begin(&self, network: &mut Network) -> Result<()> {
        network.begin_with(&self.state).map_err(|e| self.refusal(e))?;
        Ok(())
    }

    fn provenance(&self) -> Value {
        json!({ "path": self.path.display().to_string(), "identity": self.identity })
    }

    /// Says which file does not fit.
    fn refusal(&self, source: NetError) -> SystemError {
        SystemError::OtherWeights { path: self.path.clone(), source: Box::new(source) }
    }
}

/// A trained network.
#[derive(Debug)]
pub struct Trained {
    /// the network, ready to be written
    pub model: NetModel,
    /// how many items it was trained on
    pub items: usize,
    /// the group that chose the epoch, and before it its column
    pub validation_group: Option<(String, String)>,
}

/// A validation, in the terms of the classifiers'.
#[derive(Debug)]
pub struct Validated {
    /// label column that was predicted
    pub target: String,
    /// how rows were held out
    pub folds: Folds,
    /// names of the classes
    pub labels: Labels,
    /// the class of each row
    pub classes: Classes,
    /// predictions and scores
    pub result: CrossValidation,
    /// name, recipe and histories
    pub report: Value,
    /// what must be said beside the scores
    pub caution: Option<&'static str>,
}

impl Validated {
    /// The predictions of the held-out rows; `ids` are those of the table, `path` is named in messages
    /// about them.
    pub fn predictions(&self, ids: &[String], path: &Path) -> PredictionTable {
        self.result.predictions(ids, self.folds.dependent(), &self.labels, &self.classes, path)
    }

    /// Everything; `held_out` are the scores of all held-out rows together.
    pub fn to_value(&self, held_out: &ClassReport) -> Value {
        json!({
            "target": self.target,
            "labels": self.labels,
            "folds_by": self.folds.description,
            "training": self.report,
            "result": self.result,
            "held_out": held_out,
            "caution": self.caution,
        })
    }
}

impl Training<'_> {
    /// What a training would not heed, in words.
    pub fn unheeded(&self) -> Option<&'static str> {
        let is_idle = self.groups.is_some() && self.recipe.select != Select::Validation;
        is_idle.then_some(
            "--groups affects only a training whose recipe has select=validation, which holds a group out; all rows are \
             used for training",
        )
    }

    /// Trains on all items. `files` says in the model where they came from; `progress` ends the
    /// training by returning false.
    ///
    /// # Errors
    /// Labels that cannot be learned; whatever training refuses.
    pub fn train(
        &self,
        examples: &Examples,
        files: Value,
        progress: impl FnMut(Progress<'_>) -> bool,
    ) -> Result<Trained> {
        let Examples { definition, table, items, heard, .. } = examples;
        let recipe = self.recipe;
        require_whole(&recipe, examples)?;
        let (labels, classes) = table.classes(self.target)?;
        let y = examples.classes(&classes);
        let by_group = recipe.select == Select::Validation;
        let usual = || groups::usual(table, (&labels, &classes)).filter(|_| by_group);
        let column = self.groups.or_else(usual);
        let groups = column.map(|column| match by_group {
            true => groups::values(table, column, "; --groups names it"),
            false => table.column(column),
        });
        let groups = groups.transpose()?;
        let groups = groups.map(|groups| examples.of_items(&groups));
        let groups = groups.as_deref();
        let state = self.weights.map(|weights| weights.state_for(definition, &labels));
        let weights = state.as_deref();
        let device = &self.device;
        let data = Data { items, classes: &y, n_classes: labels.len(), groups, weights, device };
        let all = FoldItems { name: "all".into(), train: (0..y.len()).collect(), test: Vec::new() };
        let (train, watched, validation_group) = cross_validation::watched(data, &all, &recipe)?;
        let task = Task { items, classes: &y, train: &train, watched: &watched };
        let mut network = definition.build(Some(labels.len()), recipe.seed)?;
        network.run_on(device.clone());
        if let (Some(weights), Some(state)) = (self.weights, &state) {
            network.begin_with(state).map_err(|e| weights.refusal(e))?;
        }
        let checkpoint = self.checkpoints.map(|folder| folder.join("training.safetensors"));
        let score = |truth: &[usize], found: &[usize]| weighted_f1(truth, found, labels.len());
        let history =
            fit::fit(&mut network, task, &recipe, checkpoint.as_deref(), score, progress)?;
        let header = Header {
            format: 0,
            network: definition.name.into(),
            labels: labels.names().to_vec(),
            target: self.target.into(),
            recipe,
            gpu: device.gpu_name().map(str::to_owned),
            history,
            feature_config: heard.as_ref().map_or(Value::Null, |heard| heard.config.to_value()),
            provenance: json!({
                "files": files,
                "recordings": heard.as_ref().map(|_| table.ids.len()),
                "items": y.len(),
                "weights": self.weights.map(Weights::provenance),
                "validation_group": validation_group,
                "trained_on": heard.as_ref().and_then(|heard| heard.trained_on.as_ref()),
            }),
            tool_version: env!("CARGO_PKG_VERSION").into(),
        };
        let model = NetModel::new(header, network)?;
        let validation_group = column.map(str::to_owned).zip(validation_group);
        Ok(Trained { model, items: y.len(), validation_group })
    }

    /// The folds of a plan, or those that the labels ask for, and what is odd about them, in words.
    ///
    /// # Errors
    /// Columns that are not there, classes or groups that cannot be divided.
    pub fn folds(
        &self,
        examples: &Examples,
        plan: Option<&CvPlan>,
        seed: u32,
    ) -> Result<(Folds, Vec<String>)> {
        let (labels, classes) = examples.table.classes(self.target)?;
        let folds = Folds::new(plan, &examples.table, self.groups, (&labels, &classes), seed)?;
        let mut warnings = folds.warnings(&classes);
        let is_choice = self.recipe.select == Select::Validation;
        warnings.extend(folds.choice_warning().filter(|_| is_choice).map(String::from));
        Ok((folds, warnings))
    }

    /// Holds out parts of the rows in turn; a recording of several windows has the mean of their
    /// probabilities. `progress` is told with the name of the fold.
    ///
    /// # Errors
    /// As [`Self::train`].
    pub fn cross_validate(
        &self,
        examples: &Examples,
        folds: Folds,
        mut progress: impl FnMut(&str, Progress<'_>) -> bool,
    ) -> Result<Validated> {
        let Examples { definition, table, items, .. } = examples;
        let recipe = self.recipe;
        require_whole(&recipe, examples)?;
        let (labels, classes) = table.classes(self.target)?;
        let y = examples.classes(&classes);
        let groups = folds.choice_groups().map(|groups| examples.of_items(groups));
        let groups = groups.as_deref();
        let state = self.weights.map(|weights| weights.state_for(definition, &labels));
        let weights = state.as_deref();
        let device = &self.device;
        let data = Data { items, classes: &y, n_classes: labels.len(), groups, weights, device };
        let items_of = examples.items_of();
        let of_rows = |rows: &[usize]| -> Vec<usize> {
            rows.iter().flat_map(|&row| items_of[row].iter().copied()).collect()
        };
        let outer = folds.outer.iter().map(|fold| FoldItems {
            name: fold.name.clone(),
            train: of_rows(&fold.train),
            test: of_rows(&fold.test),
        });
        let found = cross_validation::cross_validate(
            definition,
            data,
            &outer.collect::<Vec<_>>(),
            &recipe,
            self.checkpoints,
            |truth, found| weighted_f1(truth, found, labels.len()),
            |fold, told| progress(&fold.name, told),
        );
        let found = found.map_err(|error| match (error, self.weights) {
            (error @ NetError::Weights { .. }, Some(weights)) => weights.refusal(error),
            (error, _) => error.into(),
        })?;
        let histories = found.iter().map(
            |f| json!({"fold": f.name, "validation_group": f.validation, "history": f.history}),
        );
        let mut report = json!({
            "network": definition.name,
            "recipe": recipe,
            "folds": histories.collect::<Vec<_>>(),
        });
        if let Some(gpu) = device.gpu_name() {
            report["gpu"] = gpu.into();
        }
        let mut by_fold = Vec::with_capacity(found.len());
        for (found, fold) in found.into_iter().zip(&folds.outer) {
            let mut proba = Array2::zeros((fold.test.len(), labels.len()));
            let mut windows = found.probabilities.iter();
            for (mut row, &of) in proba.rows_mut().into_iter().zip(&fold.test) {
                let mut votes = WindowVotes::new(labels.len());
                for window in windows.by_ref().take(items_of[of].len()) {
                    votes.add(argmax(window), Some(window))?;
                }
                row.iter_mut().zip(votes.mean().unwrap_or_default()).for_each(|(p, m)| *p = m);
            }
            by_fold.push((found.name, fold.test.clone(), proba));
        }
        let result = CrossValidation::of_probabilities(by_fold, &classes)?;
        let caution = (recipe.select == Select::Published).then_some(
            "scores are too good: with select=published, the held-out fold also chose the epoch",
        );
        let target = self.target.into();
        Ok(Validated { target, folds, labels, classes, result, report, caution })
    }
}

/// Refuses to choose an epoch by windows of recordings whose other windows are trained on.
fn require_whole(recipe: &Recipe, examples: &Examples) -> Result<()> {
    let several = || examples.items_of().iter().any(|items| items.len() > 1);
    if recipe.select == Select::Split && several() {
        return Err(NetError::Recipe {
            key: "select".into(),
            value: "split".into(),
            allowed: "last, validation or published: recordings have several windows, and some \
                      would be on either side of a split"
                .into(),
        }
        .into());
    }
    Ok(())
}

fn weighted_f1(truth: &[usize], found: &[usize], n_classes: usize) -> f64 {
    Scores::new(truth, found, n_classes).map_or(0.0, |s| s.weighted_f1)
}
