//! Predictions of rows that were not trained on, with or without a choice of pipeline inside.

use std::path::Path;

use linfa::DatasetBase;
use linfa::traits::Predict;
use ndarray::{Array2, ArrayView2, Axis, CowArray, Ix2};
use rayon::prelude::*;
use serde::Serialize;

use crate::classifiers::{ClassifierSpec, Predicted};
use crate::error::{ModelError, Result};
use crate::fusion::merge_classes;
use crate::labels::Labels;
use crate::pipeline::PipelineSpec;
use crate::predictions::{Id, PredictionRow, PredictionTable};
use crate::scores::Scores;
use crate::splits::Fold;
use crate::spread::Spread;
use crate::steps::{Prepared, StepSpec, through};
use crate::table::argmax;
use crate::targets::Classes;

/// Labelled rows.
#[derive(Clone, Copy, Debug)]
pub struct Data<'a> {
    /// `[rows, features]` and the classes trained on
    pub dataset: &'a DatasetBase<ArrayView2<'a, f64>, Classes>,
    /// the class scored for each class trained on, e.g. the level of each joint class: their
    /// probabilities are added up
    pub merge: Option<&'a [usize]>,
}

impl Data<'_> {
    fn classes(&self) -> &Classes {
        &self.dataset.targets
    }

    fn scored_classes(&self) -> usize {
        let all = self.classes().n_classes();
        self.merge.map_or(all, |m| m.iter().max().map_or(0, |c| c + 1))
    }

    fn scored(&self, rows: &[usize]) -> Vec<usize> {
        let y = self.classes().indices();
        let class = |&row: &usize| self.merge.map_or(y[row], |m| m[y[row]]);
        rows.iter().map(class).collect()
    }

    /// Some of the rows as a data set of their own.
    fn select(&self, rows: &[usize]) -> DatasetBase<Array2<f64>, Classes> {
        let x = self.dataset.records.select(Axis(0), rows);
        DatasetBase::new(x, self.classes().select(rows))
    }

    fn check(&self, folds: &[Fold]) -> Result<()> {
        let (x, n_classes) = (&self.dataset.records, self.classes().n_classes());
        crate::table::check_features(x.view())?;
        if self.classes().len() != x.nrows() {
            let (expected, actual) = (x.nrows(), self.classes().len());
            return Err(ModelError::Length { what: "labels", expected, actual });
        }
        if let Some(merge) = self.merge
            && merge.len() != n_classes
        {
            let what = "merged classes";
            return Err(ModelError::Length { what, expected: n_classes, actual: merge.len() });
        }
        let mut tested = vec![false; x.nrows()];
        for fold in folds {
            let refuse = |reason: &str| {
                Err(ModelError::Folds { reason: format!("fold {}: {reason}", fold.name) })
            };
            if fold.train.is_empty() || fold.test.is_empty() {
                return refuse("no training rows or no test rows");
            }
            if fold.train.iter().chain(&fold.test).any(|&row| row >= tested.len()) {
                return refuse("a row beyond the table");
            }
            let mut trained = vec![false; tested.len()];
            fold.train.iter().for_each(|&row| trained[row] = true);
            if fold.test.iter().any(|&row| trained[row]) {
                return refuse("a row is both trained on and tested");
            }
            for &row in &fold.test {
                if std::mem::replace(&mut tested[row], true) {
                    return refuse("a row is tested twice");
                }
            }
        }
        Ok(())
    }
}

/// Outcome of one fold.
#[derive(Clone, Debug, Serialize)]
pub struct FoldOutcome {
    /// what was held out
    pub name: String,
    /// rows tested
    pub rows: Vec<usize>,
    /// class predicted for each
    pub predicted: Vec<usize>,
    /// probabilities `[rows, classes]`; absent for an SVM without them
    #[serde(skip)]
    pub proba: Option<Array2<f64>>,
    /// scores of this fold
    pub scores: Scores,
    /// the pipeline used: its position among the candidates
    pub chosen: usize,
    /// mean weighted F1 of every candidate over the inner folds; empty without a choice
    pub inner: Vec<f64>,
}

/// Outcome of a cross-validation.
#[derive(Clone, Debug, Serialize)]
pub struct CrossValidation {
    /// fold by fold
    pub folds: Vec<FoldOutcome>,
    /// scores of all tested rows together
    pub pooled: Scores,
    /// accuracy over folds
    pub accuracy: Spread,
    /// weighted F1 over folds
    pub weighted_f1: Spread,
    /// macro F1 over folds
    pub macro_f1: Spread,
}

impl CrossValidation {
    /// The predictions of the held-out rows in the order of the table: columns `id`, `fold`, `group`
    /// where there are `groups`, and `true`. `ids`, the class `names` and `classes` are those of the
    /// data set.
    pub fn predictions(
        &self,
        ids: &[String],
        groups: Option<&[String]>,
        names: &Labels,
        classes: &Classes,
        path: &Path,
    ) -> PredictionTable {
        let mut rows = Vec::new();
        let truth = classes.indices();
        for fold in &self.folds {
            for (at, (&row, &class)) in fold.rows.iter().zip(&fold.predicted).enumerate() {
                let proba = fold.proba.as_ref().map(|proba| proba.row(at).to_vec());
                let name = names.names()[truth[row]].clone();
                let mut cells = vec![ids[row].clone(), fold.name.clone()];
                cells.extend(groups.map(|groups| groups[row].clone()));
                cells.push(name);
                let key = Id(ids[row].clone());
                rows.push((row, PredictionRow { key, cells, class: Some(class), proba }));
            }
        }
        rows.sort_by_key(|(row, _)| *row);
        PredictionTable {
            path: path.into(),
            columns: ["id", "fold"]
                .into_iter()
                .chain(groups.map(|_| "group"))
                .chain(["true"])
                .map(String::from)
                .collect(),
            naming: 1,
            labels: names.names().to_vec(),
            rows: rows.into_iter().map(|(_, row)| row).collect(),
            unmatched: None,
        }
    }

    /// From what other code predicted: name, rows and probabilities `[rows, classes]` of each fold.
    ///
    /// # Errors
    /// Probabilities that do not fit rows or classes.
    pub fn of_probabilities(
        folds: impl IntoIterator<Item = (String, Vec<usize>, Array2<f64>)>,
        classes: &Classes,
    ) -> Result<Self> {
        let (y, n_classes) = (classes.indices(), classes.n_classes());
        let truth = |rows: &[usize]| rows.iter().map(|&row| y[row]).collect::<Vec<_>>();
        let outcomes = folds.into_iter().map(|(name, rows, proba)| {
            if proba.dim() != (rows.len(), n_classes) {
                let (expected, actual) = (rows.len() * n_classes, proba.len());
                return Err(ModelError::Length { what: "probabilities", expected, actual });
            }
            let predicted: Vec<usize> = proba.outer_iter().map(|row| argmax(row.iter())).collect();
            let scores = Scores::new(&truth(&rows), &predicted, n_classes)?;
            let (proba, inner) = (Some(proba), Vec::new());
            Ok(FoldOutcome { name, rows, predicted, proba, scores, chosen: 0, inner })
        });
        Self::of(outcomes.collect::<Result<_>>()?, truth, n_classes)
    }

    fn of(
        folds: Vec<FoldOutcome>,
        truth: impl Fn(&[usize]) -> Vec<usize>,
        n_classes: usize,
    ) -> Result<Self> {
        let rows: Vec<usize> = folds.iter().flat_map(|f| f.rows.iter().copied()).collect();
        let predicted: Vec<usize> =
            folds.iter().flat_map(|f| f.predicted.iter().copied()).collect();
        let spread = |score: fn(&Scores) -> f64| {
            Spread::of(&folds.iter().map(|f| score(&f.scores)).collect::<Vec<_>>())
        };
        Ok(Self {
            pooled: Scores::new(&truth(&rows), &predicted, n_classes)?,
            accuracy: spread(|s| s.accuracy),
            weighted_f1: spread(|s| s.weighted_f1),
            macro_f1: spread(|s| s.macro_f1),
            folds,
        })
    }
}

/// Trains on each fold's training rows and predicts its test rows.
///
/// # Errors
/// Folds that overlap or leave a side empty, and whatever training refuses.
pub fn cross_validate(
    data: &Data<'_>,
    folds: &[Fold],
    spec: &PipelineSpec,
) -> Result<CrossValidation> {
    let mut outcomes = cross_validate_each(data, folds, std::slice::from_ref(spec))?;
    Ok(outcomes.remove(0))
}

/// The same for each of several pipelines. Steps that some share are fitted once for them; folds and
/// classifiers are computed side by side.
///
/// # Errors
/// As [`cross_validate`]: the first refusal, by fold, then by pipeline.
pub fn cross_validate_each(
    data: &Data<'_>,
    folds: &[Fold],
    specs: &[PipelineSpec],
) -> Result<Vec<CrossValidation>> {
    data.check(folds)?;
    let by_fold: Vec<Result<Vec<FoldOutcome>>> =
        folds.par_iter().map(|fold| run_fold(data, fold, specs)).collect();
    let mut outcomes = vec![Vec::with_capacity(folds.len()); specs.len()];
    for fold in by_fold {
        for (outcomes, outcome) in outcomes.iter_mut().zip(fold?) {
            outcomes.push(outcome);
        }
    }
    let joined =
        |outcomes| CrossValidation::of(outcomes, |rows| data.scored(rows), data.scored_classes());
    outcomes.into_iter().map(joined).collect()
}

/// What each pipeline makes of a fold.
fn run_fold(data: &Data<'_>, fold: &Fold, specs: &[PipelineSpec]) -> Result<Vec<FoldOutcome>> {
    // Pipelines by their steps.
    let mut groups: Vec<(&[StepSpec], Vec<usize>)> = Vec::new();
    for (i, spec) in specs.iter().enumerate() {
        match groups.iter_mut().find(|(steps, _)| *steps == spec.steps) {
            Some((_, members)) => members.push(i),
            None => groups.push((&spec.steps, vec![i])),
        }
    }
    let (train, test) = (data.select(&fold.train), data.select(&fold.test));
    let mut outcomes: Vec<(usize, Result<FoldOutcome>)> = Vec::with_capacity(specs.len());
    for (steps, members) in groups {
        let ready = Prepared::fit(steps, train.records.view()).and_then(|prepared| {
            let test = through(prepared.steps(), test.records.view())?;
            Ok((prepared, test))
        });
        match ready {
            Ok((prepared, test)) => outcomes.par_extend(members.into_par_iter().map(|i| {
                let classifier = &specs[i].classifier;
                (i, run_classifier(data, fold, classifier, (&prepared, &train.targets), &test))
            })),
            Err(error) => outcomes.push((members[0], Err(error))),
        }
    }
    outcomes.sort_by_key(|(i, _)| *i);
    outcomes.into_iter().map(|(_, outcome)| outcome).collect()
}

fn run_classifier(
    data: &Data<'_>,
    fold: &Fold,
    classifier: &ClassifierSpec,
    (prepared, classes): (&Prepared<'_>, &Classes),
    test: &CowArray<'_, f64, Ix2>,
) -> Result<FoldOutcome> {
    let fitted = prepared.train(classifier, &classes.indices().to_vec(), classes.n_classes())?;
    let predicted: Result<Predicted> = Predict::predict(&fitted, test);
    let Predicted { classes, proba } = predicted?;
    let (predicted, proba) = match (data.merge, proba) {
        (None, proba) => (classes, proba),
        (Some(merge), Some(proba)) => {
            let merged = merge_classes(proba.view(), merge, data.scored_classes())?;
            (merged.outer_iter().map(|row| argmax(row.iter())).collect(), Some(merged))
        }
        (Some(_), None) => {
            let owner = classifier.name();
            let remedy = "merged classes add them up, so train with probabilities";
            return Err(ModelError::NoProbability { owner, remedy });
        }
    };
    let scores = Scores::new(&data.scored(&fold.test), &predicted, data.scored_classes())?;
    let (name, rows) = (fold.name.clone(), fold.test.clone());
    Ok(FoldOutcome { name, rows, predicted, proba, scores, chosen: 0, inner: Vec::new() })
}

/// Nested cross-validation: in every fold the pipeline is chosen on the training rows alone, by
/// the mean weighted F1 over inner folds (the first among equals), then fitted on all of them.
/// `inner` makes the inner folds from the outer training rows; its row numbers are positions in
/// that list.
///
/// # Errors
/// No candidate, or as [`cross_validate`].
pub fn nested_cross_validate(
    data: &Data<'_>,
    folds: &[Fold],
    candidates: &[PipelineSpec],
    inner: impl Fn(&[usize]) -> Result<Vec<Fold>> + Sync,
) -> Result<CrossValidation> {
    data.check(folds)?;
    let run = |fold: &Fold| {
        let (chosen, scores) = choose(data, &fold.train, candidates, &inner)?;
        let outcome = run_fold(data, fold, std::slice::from_ref(&candidates[chosen]))?.remove(0);
        Ok(FoldOutcome { chosen, inner: scores, ..outcome })
    };
    let outcomes: Vec<Result<FoldOutcome>> = folds.par_iter().map(run).collect();
    let outcomes = outcomes.into_iter().collect::<Result<_>>()?;
    CrossValidation::of(outcomes, |rows| data.scored(rows), data.scored_classes())
}

/// The candidate with the best mean weighted F1 over inner folds of `rows`, and all the means.
///
/// # Errors
/// No candidate, or as [`cross_validate`].
pub fn choose(
    data: &Data<'_>,
    rows: &[usize],
    candidates: &[PipelineSpec],
    inner: impl Fn(&[usize]) -> Result<Vec<Fold>>,
) -> Result<(usize, Vec<f64>)> {
    if candidates.is_empty() {
        return Err(ModelError::Folds { reason: "no pipeline to choose from".into() });
    }
    let inside = data.select(rows);
    let inside = DatasetBase::new(inside.records.view(), inside.targets.clone());
    let inside = Data { dataset: &inside, ..*data };
    let inner_folds = inner(rows)?;
    let validated = cross_validate_each(&inside, &inner_folds, candidates)?;
    let scores: Vec<f64> = validated.iter().map(|cv| cv.weighted_f1.mean).collect();
    Ok((argmax(&scores), scores))
}
