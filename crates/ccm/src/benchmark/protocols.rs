//! The published and the corrected protocol.
//!
//! Baselines on the same values run together: scaled and reduced tables are made once for all of
//! their classifiers, which are then trained side by side.

use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_models::classifiers::Classifier;
use corsmal_models::cross_validation::{Data, cross_validate_each};
use corsmal_models::pipeline::{Pipeline, PipelineSpec};
use corsmal_models::splits::{Fold, group_lists, train_test_split};
use corsmal_models::steps::{Components, PcaParams, Prepared, StepSpec, through};
use corsmal_models::targets::Classes;
use corsmal_models::{ModelError, argmax};
use linfa::DatasetBase;
use ndarray::{Array2, ArrayView2, Axis, CowArray, Ix2};
use rayon::prelude::*;

use super::baselines::{Baseline, BaselineResult, Variant};
use super::matrix::Matrices;
use super::results::{Estimate, Rows, Target};
use crate::dataset::{CONTAINER_FOLDS, Filling, PublishedSplit};
use crate::error::{CcmError, Result};

/// Principal components of the baselines.
const COMPONENTS: usize = 128;

/// Recordings of the training part of the real data set.
const ALL_TRAINING: usize = 684;

/// What the baselines of a feature set run on.
pub(super) struct Setting<'a> {
    pub(super) rows: &'a Rows,
    pub(super) matrices: &'a Matrices,
    pub(super) seed: u64,
    /// Ends the work at the next baseline.
    pub(super) stop: &'a AtomicBool,
    /// Takes what is finished, with the pipeline that predicted the tests.
    pub(super) finish: &'a Finish<'a>,
}

/// Takes the outcome of a baseline on the features, and its pipeline.
pub(super) type Finish<'a> =
    dyn Fn(&Matrices, &BaselineResult, (PipelineSpec, Pipeline)) -> Result<()> + Sync + 'a;

/// Baselines on the same values under one protocol.
pub(super) struct Unit {
    variant: Variant,
    pca: bool,
    baselines: Vec<Baseline>,
}

type ModelResult<T> = std::result::Result<T, ModelError>;

impl Unit {
    /// The units of baselines of one feature set.
    pub(super) fn all(wanted: &[Baseline]) -> Vec<Self> {
        let mut units = Vec::new();
        for variant in Variant::ALL {
            for pca in [false, true] {
                let baselines: Vec<Baseline> =
                    wanted.iter().filter(|b| b.pca == pca).copied().collect();
                if !baselines.is_empty() {
                    units.push(Self { variant, pca, baselines });
                }
            }
        }
        units
    }

    /// The outcomes of all baselines, in their order.
    pub(super) fn run(&self, setting: &Setting<'_>) -> Result<Vec<BaselineResult>> {
        match self.variant {
            Variant::Published => self.published(setting),
            Variant::Corrected => self.corrected(setting),
        }
    }

    /// Says which baseline a refusal is about.
    fn fault(&self, baseline: &Baseline, error: &ModelError) -> CcmError {
        CcmError::Request(format!("{} ({}): {error}", baseline.name(), self.variant.name()))
    }

    /// Runs every baseline by `one`, given its number, side by side.
    fn each(
        &self,
        setting: &Setting<'_>,
        one: impl Fn(usize, &Baseline) -> ModelResult<(BaselineResult, PipelineSpec, Pipeline)> + Sync,
    ) -> Result<Vec<BaselineResult>> {
        let finished: Vec<Result<BaselineResult>> = self
            .baselines
            .par_iter()
            .enumerate()
            .map(|(i, baseline)| {
                if setting.stop.load(Ordering::Relaxed) {
                    return Err(CcmError::Interrupted);
                }
                let (outcome, spec, model) =
                    one(i, baseline).map_err(|e| self.fault(baseline, &e))?;
                (setting.finish)(setting.matrices, &outcome, (spec, model))?;
                Ok(outcome)
            })
            .collect();
        finished.into_iter().collect()
    }

    fn published(&self, setting: &Setting<'_>) -> Result<Vec<BaselineResult>> {
        let Setting { rows, matrices, seed, .. } = *setting;
        let fault = |e: ModelError| self.fault(&self.baselines[0], &e);
        let joint = rows.joint();
        let fold = split(&joint).map_err(fault)?;
        // The published code fits PCA on all training recordings, the held-out ones included, and
        // anew on every test part.
        let least = matrices.tests.iter().map(Array2::nrows).filter(|&n| n > 1);
        let components =
            least.chain([matrices.training.nrows()]).min().unwrap_or(1).min(COMPONENTS);
        let tables: Vec<&Array2<f64>> =
            std::iter::once(&matrices.training).chain(&matrices.tests).collect();
        let reduced: Vec<ModelResult<CowArray<f64, Ix2>>> = tables
            .into_par_iter()
            .map(|x| {
                if !self.pca {
                    return Ok(x.view().into());
                }
                if x.nrows() <= 1 {
                    // One recording is its own mean: it lies at the origin.
                    return Ok(Array2::zeros((x.nrows(), components)).into());
                }
                Ok(pca(components).fit(x.view())?.transform(x.view())?.into())
            })
            .collect();
        let reduced: Vec<CowArray<f64, Ix2>> =
            reduced.into_iter().collect::<ModelResult<_>>().map_err(fault)?;
        let (x, tests) = (&reduced[0], &reduced[1..]);
        let y: Vec<usize> = fold.train.iter().map(|&row| joint[row]).collect();
        let trained = x.select(Axis(0), &fold.train).into_shared();
        self.each(setting, |_, baseline| {
            let spec = PipelineSpec::plain(baseline.learner.spec(seed));
            let classifier = spec.classifier.train_shared(&trained, &y, Filling::COUNT)?;
            let seen = estimates(&classifier, x.view())?;
            let tests = tests.iter().map(|x| estimates(&classifier, x.view()));
            let outcome = BaselineResult {
                baseline: *baseline,
                variant: self.variant,
                held_out: fold.test.iter().map(|&row| (row, seen[row].clone())).collect(),
                seen,
                tests: tests.collect::<ModelResult<_>>()?,
                config: matrices.config.clone(),
            };
            Ok((outcome, spec, Pipeline::new(Vec::new(), classifier)?))
        })
    }

    fn corrected(&self, setting: &Setting<'_>) -> Result<Vec<BaselineResult>> {
        let Setting { rows, matrices, seed, .. } = *setting;
        let fault = |e: ModelError| self.fault(&self.baselines[0], &e);
        let joint = rows.joint();
        let folds = container_folds(&rows.training).map_err(fault)?;
        let least = folds.iter().map(|f| f.train.len()).min().unwrap_or(1);
        let mut steps = vec![StepSpec::Standardize(Default::default())];
        if self.pca {
            steps.push(pca(COMPONENTS.min(least)));
        }
        let spec = |baseline: &Baseline| PipelineSpec {
            steps: steps.clone(),
            classifier: baseline.learner.spec(seed),
        };
        let specs: Vec<PipelineSpec> = self.baselines.iter().map(spec).collect();
        let classes = Classes::new(joint.clone(), Filling::COUNT).map_err(fault)?;
        let dataset = DatasetBase::new(matrices.training.view(), classes);
        let data = Data { dataset: &dataset, merge: None };
        let (validated, prepared) = rayon::join(
            || cross_validate_each(&data, &folds, &specs),
            || Prepared::fit(&steps, matrices.training.view()),
        );
        let (validated, prepared) = (validated.map_err(fault)?, prepared.map_err(fault)?);
        let tests = matrices.tests.iter().map(|x| through(prepared.steps(), x.view()));
        let tests = tests.collect::<ModelResult<Vec<_>>>().map_err(fault)?;
        self.each(setting, |i, baseline| {
            let mut held_out = Vec::with_capacity(joint.len());
            for fold in &validated[i].folds {
                for (at, (&row, &class)) in fold.rows.iter().zip(&fold.predicted).enumerate() {
                    let p = fold.proba.as_ref().map(|p| p.row(at).to_vec());
                    held_out.push((row, Estimate::joint(class, p.as_deref())));
                }
            }
            held_out.sort_by_key(|(row, _)| *row);
            let spec = specs[i].clone();
            let classifier = prepared.train(&spec.classifier, &joint, Filling::COUNT)?;
            let tests = tests.iter().map(|x| estimates(&classifier, x.view()));
            let outcome = BaselineResult {
                baseline: *baseline,
                variant: self.variant,
                held_out,
                seen: Vec::new(),
                tests: tests.collect::<ModelResult<_>>()?,
                config: matrices.config.clone(),
            };
            Ok((outcome, spec, Pipeline::new(prepared.steps().to_vec(), classifier)?))
        })
    }
}

fn pca(components: usize) -> StepSpec {
    StepSpec::Pca(PcaParams { n_components: Some(Components::Count(components.max(1))) })
}

/// The published split; for other numbers of recordings one by the same rule.
fn split(joint: &[usize]) -> ModelResult<Fold> {
    if joint.len() == ALL_TRAINING
        && let Ok(fold) = PublishedSplit::Baselines.rows()
    {
        return Ok(fold);
    }
    train_test_split(joint.len(), 0.2, 42, Some(joint))
}

/// The three folds of containers; of a set with fewer containers, those that are there.
pub(super) fn container_folds(targets: &[Target]) -> ModelResult<Vec<Fold>> {
    let number = |t: &Target| t.recording.container.map_or(0, |c| c.number());
    let groups: Vec<String> = targets.iter().map(|t| number(t).to_string()).collect();
    let lists: Vec<Vec<String>> = CONTAINER_FOLDS
        .iter()
        .map(|fold| fold.iter().map(u8::to_string).filter(|c| groups.contains(c)).collect())
        .filter(|list: &Vec<String>| !list.is_empty())
        .collect();
    group_lists(&groups, &lists)
}

/// What a classifier of the baselines says. One that has probabilities chooses the most probable
/// class.
fn estimates(classifier: &Classifier, x: ArrayView2<'_, f64>) -> ModelResult<Vec<Estimate>> {
    match classifier.predict_proba(x) {
        Ok(proba) => Ok(proba
            .outer_iter()
            .map(|row| Estimate::joint(argmax(row.iter()), Some(&row.to_vec())))
            .collect()),
        Err(ModelError::NoProbability { .. }) => {
            let classes = classifier.predict(x)?;
            Ok(classes.into_iter().map(|class| Estimate::joint(class, None)).collect())
        }
        Err(error) => Err(error),
    }
}
