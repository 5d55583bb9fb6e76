//! The twelve audio baselines: four feature sets, three classifiers, seven joint classes.

use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_models::classifiers::{
    ClassifierSpec, Gamma, KNearestParams, RandomForestParams, SvmParams,
};
use corsmal_models::model_file::TrainedOn;
use corsmal_models::pipeline::{Pipeline, PipelineSpec};
use corsmal_models::splits::{Fold, group_lists, train_test_split};
use corsmal_models::steps::{Components, PcaParams, StepSpec};
use corsmal_models::targets::Classes;
use corsmal_models::{ModelError, cross_validation};
use linfa::DatasetBase;
use linfa::traits::Fit;
use ndarray::{Array2, ArrayView2, Axis};

use super::features::FeatureSet;
use super::matrix::Matrices;
use super::results::{Estimate, Rows, Target};
use crate::dataset::{CONTAINER_FOLDS, Filling, PublishedSplit};
use crate::error::{CcmError, Result};

/// Principal components of the baselines.
const COMPONENTS: usize = 128;

/// Recordings of the training part of the real data set.
const ALL_TRAINING: usize = 684;

/// A classifier with the published settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learner {
    /// Five nearest neighbours.
    Knn,
    /// RBF support vector machine, C 20, gamma 1e-5.
    Svm,
    /// Random forest of 100 trees.
    Forest,
}

/// A feature set with a classifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Baseline {
    /// The features.
    pub features: FeatureSet,
    /// Reduced to 128 principal components.
    pub pca: bool,
    /// The classifier.
    pub learner: Learner,
}

/// How a baseline is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// As the published code: no scaling, a random split of recordings, PCA fitted anew on every
    /// part.
    Published,
    /// Scaled features, PCA fitted on training data only, containers held out.
    Corrected,
}

impl Variant {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Published, Self::Corrected];

    /// Name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Corrected => "corrected",
        }
    }
}

impl Learner {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Knn, Self::Svm, Self::Forest];

    fn name(self) -> &'static str {
        match self {
            Self::Knn => "kNN",
            Self::Svm => "SVM",
            Self::Forest => "RF",
        }
    }

    fn spec(self, seed: u64) -> ClassifierSpec {
        match self {
            Self::Knn => KNearestParams::default().into(),
            Self::Svm => SvmParams {
                C: 20.0,
                gamma: Gamma::Value(1e-5),
                probability: false,
                ..Default::default()
            }
            .into(),
            Self::Forest => RandomForestParams { seed, ..Default::default() }.into(),
        }
    }
}

/// What a baseline predicts.
pub(super) struct Outcome {
    pub(super) baseline: Baseline,
    pub(super) variant: Variant,
    /// Row numbers of training recordings that were not trained on, with their estimates: the held
    /// out 20 % (published) or all of them, fold by fold (corrected).
    pub(super) held_out: Vec<(usize, Estimate)>,
    /// Estimates for all training recordings by a model that knows most of them (published only).
    pub(super) seen: Vec<Estimate>,
    /// Estimates of each test part.
    pub(super) tests: Vec<Vec<Estimate>>,
    /// The pipeline that predicted the tests, and what it is.
    pub(super) model: Pipeline,
    pub(super) spec: PipelineSpec,
    /// The features that it takes.
    pub(super) config: Arc<Config>,
    pub(super) feature_names: Vec<String>,
    /// Formats of the recordings that it was trained on.
    pub(super) trained_on: Option<TrainedOn>,
}

impl Baseline {
    /// The twelve in the paper's order of features.
    pub fn all() -> Vec<Self> {
        let mut list = Vec::new();
        for (features, pca) in [
            (FeatureSet::ZcrMfcc, false),
            (FeatureSet::Af193, false),
            (FeatureSet::Spectrogram, false),
            (FeatureSet::Spectrogram, true),
        ] {
            list.extend(Learner::ALL.map(|learner| Self { features, pca, learner }));
        }
        list
    }

    /// Name as the paper prints it.
    pub fn name(&self) -> String {
        let pca = if self.pca { " + PCA" } else { "" };
        format!("{}{pca} + {}", self.features.name(), self.learner.name())
    }

    /// Name in files and on the command line, such as `spectrogram-pca-svm`.
    pub fn slug(&self) -> String {
        let pca = if self.pca { "-pca" } else { "" };
        format!("{}{pca}-{}", self.features.slug(), self.learner.name().to_lowercase())
    }

    pub(super) fn run(
        &self,
        variant: Variant,
        rows: &Rows,
        matrices: &Matrices,
        seed: u64,
    ) -> Result<Outcome> {
        let outcome = match variant {
            Variant::Published => self.published(rows, matrices, seed),
            Variant::Corrected => self.corrected(rows, matrices, seed),
        };
        outcome.map_err(|e| CcmError::Request(format!("{} ({}): {e}", self.name(), variant.name())))
    }

    fn published(
        &self,
        rows: &Rows,
        matrices: &Matrices,
        seed: u64,
    ) -> std::result::Result<Outcome, ModelError> {
        let joint = rows.joint();
        let fold = split(&joint)?;
        let spec = PipelineSpec::plain(self.learner.spec(seed));
        // The published code fits PCA on all training recordings, the held-out ones included, and
        // anew on every test part.
        let least = matrices.tests.iter().map(Array2::nrows).filter(|&n| n > 1);
        let components =
            least.chain([matrices.training.nrows()]).min().unwrap_or(1).min(COMPONENTS);
        let reduce = |x: ArrayView2<'_, f64>| -> std::result::Result<Array2<f64>, ModelError> {
            if !self.pca {
                return Ok(x.to_owned());
            }
            if x.nrows() <= 1 {
                // One recording is its own mean: it lies at the origin.
                return Ok(Array2::zeros((x.nrows(), components)));
            }
            pca(components).fit(x)?.transform(x)
        };
        let x = reduce(matrices.training.view())?;
        let y: Vec<usize> = fold.train.iter().map(|&row| joint[row]).collect();
        let model = spec.train(x.select(Axis(0), &fold.train).view(), &y, Filling::COUNT)?;
        let seen = estimates(&model, x.view())?;
        let tests = matrices
            .tests
            .iter()
            .map(|x| estimates(&model, reduce(x.view())?.view()))
            .collect::<std::result::Result<_, _>>()?;
        Ok(Outcome {
            baseline: *self,
            variant: Variant::Published,
            held_out: fold.test.iter().map(|&row| (row, seen[row].clone())).collect(),
            seen,
            tests,
            model,
            spec,
            config: matrices.config.clone(),
            feature_names: matrices.names.clone(),
            trained_on: matrices.trained_on.clone(),
        })
    }

    fn corrected(
        &self,
        rows: &Rows,
        matrices: &Matrices,
        seed: u64,
    ) -> std::result::Result<Outcome, ModelError> {
        let joint = rows.joint();
        let folds = container_folds(&rows.training)?;
        let least = folds.iter().map(|f| f.train.len()).min().unwrap_or(1);
        let mut spec = PipelineSpec::standardized(self.learner.spec(seed));
        if self.pca {
            spec.steps.push(pca(COMPONENTS.min(least)));
        }
        let classes = Classes::new(joint, Filling::COUNT)?;
        let dataset = DatasetBase::new(matrices.training.view(), classes);
        let data = cross_validation::Data { dataset: &dataset, merge: None };
        let validated = cross_validation::cross_validate(&data, &folds, &spec)?;
        let mut held_out = Vec::with_capacity(dataset.targets.len());
        for fold in &validated.folds {
            for (i, (&row, &class)) in fold.rows.iter().zip(&fold.predicted).enumerate() {
                let p = fold.proba.as_ref().map(|p| p.row(i).to_vec());
                held_out.push((row, Estimate::joint(class, p.as_deref())));
            }
        }
        held_out.sort_by_key(|(row, _)| *row);
        let model = spec.fit(&dataset)?;
        let tests = matrices
            .tests
            .iter()
            .map(|x| estimates(&model, x.view()))
            .collect::<std::result::Result<_, _>>()?;
        Ok(Outcome {
            baseline: *self,
            variant: Variant::Corrected,
            held_out,
            seen: Vec::new(),
            tests,
            model,
            spec,
            config: matrices.config.clone(),
            feature_names: matrices.names.clone(),
            trained_on: matrices.trained_on.clone(),
        })
    }
}

fn pca(components: usize) -> StepSpec {
    StepSpec::Pca(PcaParams { n_components: Some(Components::Count(components.max(1))) })
}

/// The published split; for other numbers of recordings one by the same rule.
fn split(joint: &[usize]) -> std::result::Result<Fold, ModelError> {
    if joint.len() == ALL_TRAINING
        && let Ok(fold) = PublishedSplit::Baselines.rows()
    {
        return Ok(fold);
    }
    train_test_split(joint.len(), 0.2, 42, Some(joint))
}

/// The three folds of containers; of a set with fewer containers, those that are there.
pub(super) fn container_folds(targets: &[Target]) -> std::result::Result<Vec<Fold>, ModelError> {
    let number = |t: &Target| t.recording.container.map_or(0, |c| c.number());
    let groups: Vec<String> = targets.iter().map(|t| number(t).to_string()).collect();
    let lists: Vec<Vec<String>> = CONTAINER_FOLDS
        .iter()
        .map(|fold| fold.iter().map(u8::to_string).filter(|c| groups.contains(c)).collect())
        .filter(|list: &Vec<String>| !list.is_empty())
        .collect();
    group_lists(&groups, &lists)
}

fn estimates(
    model: &Pipeline,
    x: ArrayView2<'_, f64>,
) -> std::result::Result<Vec<Estimate>, ModelError> {
    let classes = model.predict(x)?;
    let probabilities = match model.predict_proba(x) {
        Ok(p) => Some(p),
        Err(ModelError::NoProbability { .. }) => None,
        Err(e) => return Err(e),
    };
    let row_of = |row| probabilities.as_ref().map(|p| p.row(row).to_vec());
    let estimate = |(row, class)| Estimate::joint(class, row_of(row).as_deref());
    Ok(classes.into_iter().enumerate().map(estimate).collect())
}
