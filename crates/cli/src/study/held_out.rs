//! The report of a cross-validation.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use corsmal_models::cross_validation::CrossValidation;
use corsmal_models::dataset::LabelledTable;
use corsmal_models::explain::{Setting, families, learning_curve, permutation_importance};
use corsmal_models::folds::Folds;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::predictions::PredictionTable;
use corsmal_models::scores::{ClassReport, Scores};
use corsmal_models::targets::Classes;
use corsmal_report::Fact;
use corsmal_report::study::{Importance, LearningPoint, Study};

use super::page::{add_file, add_made, file_name, write};
use super::recordings::{self, Source};
use super::scored::of_predictions;
use crate::failure::Failure;
use crate::progress::fault;

/// Repetitions of each permutation.
const REPEATS: usize = 5;
/// Shares of the training rows in a learning curve.
const SHARES: [f64; 5] = [0.1, 0.25, 0.5, 0.75, 1.0];

/// Predictions of held-out rows with all that is known of them.
pub struct HeldOut<'a> {
    /// the data
    pub table: &'a LabelledTable,
    /// the file of labels, where there is one
    pub labels: Option<&'a Path>,
    /// the column predicted
    pub target: &'a str,
    /// the class of each row
    pub classes: &'a Classes,
    /// how rows were held out
    pub folds: &'a Folds,
    /// scores fold by fold
    pub result: &'a CrossValidation,
    /// what was predicted
    pub predictions: &'a PredictionTable,
    /// scores of all together
    pub scores: &'a ClassReport,
    /// scores with other seeds
    pub seeds: &'a [(u32, Scores)],
    /// what was warned of
    pub warnings: Vec<String>,
    /// what was trained
    pub facts: Vec<Fact>,
    /// nothing but warnings
    pub quiet: bool,
}

/// What is trained anew to see what it relies on, and whether more rows would help.
pub struct Explained<'a> {
    /// the pipeline
    pub spec: &'a PipelineSpec,
    /// of permutations and parts
    pub seed: u32,
}

impl HeldOut<'_> {
    /// Writes the report into a folder.
    pub fn write(self, folder: &Path, explained: Option<&Explained<'_>>) -> Result<(), Failure> {
        let percents =
            |s: &Scores| [s.accuracy, s.weighted_f1, s.macro_f1].map(|v| 100.0 * v).to_vec();
        let mut study = Study {
            title: format!("{} from {}", self.target, file_name(&self.table.path)),
            target: self.target.into(),
            protocol: format!(
                "Every row is predicted by a model that was not trained on it. Held out: {}.",
                self.folds.description
            ),
            folds: self
                .result
                .folds
                .iter()
                .map(|fold| (fold.name.clone(), percents(&fold.scores)))
                .collect(),
            seeds: self.seeds.iter().map(|(seed, scores)| (*seed, percents(scores))).collect(),
            ..of_predictions(self.predictions, None, self.scores)?
        };
        self.add_stretches(&mut study);
        let left_out = match explained {
            Some(explained) => self.explain(&mut study, explained)?,
            None => None,
        };
        recordings::add(&mut study, self.sources(), self.quiet);
        add_file(&mut study.facts, "Features", &self.table.path);
        if let Some(labels) = self.labels {
            add_file(&mut study.facts, "Labels", labels);
        }
        study.facts.extend(self.facts);
        study.facts.push(Fact::new("Held out", &self.folds.description));
        let cautions = self.warnings.into_iter();
        study.facts.extend(cautions.chain(left_out).map(|caution| Fact::new("Caution", caution)));
        if !self.table.config_hash.is_empty() {
            study.facts.push(Fact::new("Feature configuration", &self.table.config_hash));
        }
        add_made(&mut study.facts);
        write(folder, &study.report()?, self.quiet)
    }

    /// Where rows that are stretches lie in their recordings.
    fn add_stretches(&self, study: &mut Study) {
        let outcomes = self.table.outcomes.iter();
        let stretches: HashMap<&str, (f64, f64)> =
            outcomes.filter_map(|o| Some((o.id.as_str(), o.stretch()?))).collect();
        for prediction in &mut study.predictions {
            prediction.stretch = stretches.get(prediction.id.as_str()).copied();
        }
    }

    /// Why a part of the learning curve is missing, if it is.
    fn explain(&self, study: &mut Study, with: &Explained<'_>) -> Result<Option<String>, Failure> {
        let classes = self.classes.indices().to_vec();
        let setting = Setting {
            x: self.table.x.view(),
            y: &classes,
            n_classes: self.classes.n_classes(),
            folds: &self.folds.outer,
            groups: self.folds.dependent(),
            spec: with.spec,
        };
        let families = families(&self.table.feature_names);
        if families.len() > 1 {
            let found = permutation_importance(&setting, &families, REPEATS, with.seed)?;
            let importance = found.into_iter().map(|i| Importance {
                family: i.family,
                features: i.features,
                loss: 100.0 * i.mean,
                range: (100.0 * i.low, 100.0 * i.high),
            });
            study.importances = importance.collect();
        }
        let curve = learning_curve(&setting, &SHARES, with.seed)?;
        let point = curve.points.into_iter().map(|p| LearningPoint {
            rows: p.rows,
            accuracy: 100.0 * p.mean,
            range: (100.0 * p.low, 100.0 * p.high),
        });
        study.learning = point.collect();
        let is_there = study.learning.len() > 1;
        Ok(curve.refused.map(|(share, reason)| match is_there {
            true => format!(
                "The learning curve has no point at {} % of the training rows: {reason}.",
                100.0 * share
            ),
            false => format!("There is no learning curve: {reason}."),
        }))
    }

    fn sources(&self) -> Vec<Source> {
        let classes = self.classes.indices().to_vec();
        let class_of: HashMap<&str, usize> =
            self.table.ids.iter().map(String::as_str).zip(classes).collect();
        let source = self.table.outcomes.iter().map(|outcome| Source {
            id: outcome.id.clone(),
            path: PathBuf::from(&outcome.path),
            class: class_of.get(outcome.id.as_str()).copied(),
            stretch: outcome.stretch(),
            identity: outcome.identity.clone(),
            unused: (!outcome.status.has_features())
                .then(|| format!("not in the scores: {}", fault(outcome))),
        });
        source.collect()
    }
}
