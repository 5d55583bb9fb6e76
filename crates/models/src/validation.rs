//! A cross-validation of a labelled table, with everything that a report of it says.

use std::path::Path;

use serde::Serialize;

use crate::cross_validation::{CrossValidation, Data, cross_validate, nested_cross_validate};
use crate::cv_plan::CvPlan;
use crate::dataset::{DatasetError, LabelledTable, Result};
use crate::dominance::dominance;
use crate::folds::Folds;
use crate::labels::Labels;
use crate::pipeline::PipelineSpec;
use crate::predictions::PredictionTable;
use crate::scores::{ClassReport, ScoreReport, Scoring};
use crate::targets::Classes;

/// What was validated, how, and with which result.
#[derive(Clone, Debug, Serialize)]
pub struct Validation {
    /// the feature file
    pub features: String,
    /// the column predicted
    pub target: String,
    /// names of the classes
    pub labels: Labels,
    /// rows of the table
    pub rows: usize,
    /// features of each
    pub n_features: usize,
    /// how rows were held out, in words
    pub folds_by: String,
    /// seed of shuffled folds
    pub seed: u32,
    /// the pipelines that were chosen from
    pub candidates: Vec<PipelineSpec>,
    /// predictions and scores
    pub result: CrossValidation,
    /// scores of all held-out rows together, with bootstrap intervals and calibration
    pub held_out: ClassReport,
    /// what is odd, in words
    pub warnings: Vec<String>,
    /// the folds
    #[serde(skip)]
    pub folds: Folds,
    /// the class of each row
    #[serde(skip)]
    pub classes: Classes,
}

/// Holds out parts of a table in turn and predicts them by what the rest teaches. With several
/// candidates one is chosen in every fold, on inner folds of its training rows.
///
/// # Errors
/// Columns that are not there, classes or groups that cannot be divided, and what training refuses.
pub fn validate(
    table: &LabelledTable,
    target: &str,
    candidates: Vec<PipelineSpec>,
    (plan, groups): (Option<&CvPlan>, Option<&str>),
    seed: u32,
) -> Result<Validation> {
    let (labels, classes) = table.classes(target)?;
    let folds = Folds::new(plan, table, groups, (&labels, &classes), seed)?;
    let mut warnings: Vec<String> = table.unmatched.iter().cloned().collect();
    warnings.extend(folds.warnings(&classes));
    let is_choice = candidates.len() > 1;
    warnings.extend(folds.choice_warning().filter(|_| is_choice).map(String::from));
    warnings.extend(dominance(&candidates, table));
    let dataset = table.dataset(classes.clone());
    let data = Data { dataset: &dataset, merge: None };
    let result = match candidates.as_slice() {
        [only] => cross_validate(&data, &folds.outer, only)?,
        _ => nested_cross_validate(&data, &folds.outer, &candidates, |rows| {
            folds.inner(rows, &classes)
        })?,
    };
    let held_out = held_out(&result.predictions(
        &table.ids,
        folds.dependent(),
        &labels,
        &classes,
        &table.path,
    ))?;
    Ok(Validation {
        features: table.path.display().to_string(),
        target: target.into(),
        labels,
        rows: classes.len(),
        n_features: table.x.ncols(),
        folds_by: folds.description.clone(),
        seed,
        candidates,
        result,
        held_out,
        warnings,
        folds,
        classes,
    })
}

impl Validation {
    /// The predictions of the held-out rows; `ids` are those of the table, `path` is named in
    /// messages about them.
    pub fn predictions(&self, ids: &[String], path: &Path) -> PredictionTable {
        let groups = self.folds.dependent();
        self.result.predictions(ids, groups, &self.labels, &self.classes, path)
    }
}

/// Scores of the predictions of held-out rows, as `score` gives them.
///
/// # Errors
/// Rows that have no true class.
pub fn held_out(predictions: &PredictionTable) -> Result<ClassReport> {
    let refuse = |reason: String| DatasetError::content(&predictions.path, reason);
    match predictions.score(&Scoring::default()).map_err(|e| refuse(e.to_string()))? {
        ScoreReport::Classes(report) => Ok(*report),
        ScoreReport::Numbers(_) => Err(refuse("predictions are numbers, not classes".into())),
    }
}
