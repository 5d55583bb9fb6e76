//! Prediction files: cross-validation, fusion, comparison, scores. Results cross as JSON and CSV.

use std::path::{Path, PathBuf};

use corsmal_ccm::fused;
use corsmal_models::comparison::compare;
use corsmal_models::dataset::{LabelSource, LabelledTable, MemberNames};
use corsmal_models::labels::Labels;
use corsmal_models::predictions::PredictionTable;
use corsmal_models::request::PipelineRequest;
use corsmal_models::scores::Scoring;
use corsmal_models::validation::validate;
use corsmal_models::voting::VotingRule;
use pyo3::prelude::*;

use crate::errors::value_error;
use crate::pool::compute;

/// Where labels come from.
#[derive(FromPyObject)]
pub(crate) struct LabelArguments {
    #[pyo3(item)]
    file: Option<PathBuf>,
    #[pyo3(item)]
    folders: Option<String>,
    #[pyo3(item)]
    id_column: Option<String>,
}

impl LabelArguments {
    fn source(self) -> Option<LabelSource> {
        match (self.file, self.folders) {
            (Some(path), _) => Some(LabelSource::File { path, key: self.id_column }),
            (None, Some(column)) => Some(LabelSource::Folders { column }),
            (None, None) => None,
        }
    }
}

/// Which pipelines are tried.
#[derive(FromPyObject)]
pub(crate) struct RecipeArguments {
    #[pyo3(item)]
    classifier: String,
    #[pyo3(item)]
    parameters: Vec<String>,
    #[pyo3(item)]
    standardize: bool,
    #[pyo3(item)]
    pca: Option<String>,
    #[pyo3(item)]
    tune: Vec<String>,
    #[pyo3(item)]
    seed: u32,
}

/// Whether a column is named like a value of a summary.
#[pyfunction]
pub(crate) fn is_statistic(column: &str) -> bool {
    corsmal_files::statistic::is_column(column)
}

/// The report as JSON, and the predictions of the held-out rows as CSV.
#[pyfunction]
pub(crate) fn cross_validate(
    py: Python<'_>,
    features: PathBuf,
    target: &str,
    labels: LabelArguments,
    groups: Option<&str>,
    cv: Option<&str>,
    recipe: RecipeArguments,
) -> PyResult<(String, String)> {
    let plan = cv.map(str::parse).transpose().map_err(|e| value_error(format!("cv = {e}")))?;
    let seed = recipe.seed;
    let recipe = PipelineRequest {
        classifier: recipe.classifier,
        parameters: recipe.parameters,
        standardize: recipe.standardize,
        pca: recipe.pca,
        tune: recipe.tune,
        seed,
    };
    let candidates = recipe.candidates().map_err(value_error)?;
    let source = labels.source();
    compute(py, || {
        let mut table = LabelledTable::read(&features, &MemberNames::default())?;
        let replaced = source.as_ref().map(|source| table.add_labels(source)).transpose()?;
        let replaced = replaced.into_iter().flatten();
        let mut odd: Vec<String> = replaced
            .map(|column| {
                format!("the column {column} of the features is replaced by that of --labels")
            })
            .collect();
        odd.extend(table.unmatched.take());
        table.check()?;
        odd.extend(table.doubts());
        let mut validation = validate(&table, target, candidates, (plan.as_ref(), groups), seed)?;
        validation.warnings.splice(0..0, odd);
        let held_out = validation.predictions(&table.ids, Path::new("the held-out predictions"));
        Ok((validation, held_out))
    })?
    .map_err(|e: corsmal_models::dataset::DatasetError| value_error(e))
    .and_then(|(validation, held_out)| {
        Ok((serde_json::to_string(&validation).map_err(value_error)?, csv(held_out.to_csv())?))
    })
}

/// The fused predictions as CSV, and what is to be warned of.
#[pyfunction]
pub(crate) fn fuse(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    weights: Option<Vec<f64>>,
    vote: Option<&str>,
    background: Option<&str>,
    least: usize,
) -> PyResult<(String, Vec<String>)> {
    if background.is_some() && matches!(vote, None | Some("mean")) {
        return Err(value_error("background needs vote = majority"));
    }
    if background.is_none() && least != 1 {
        return Err(value_error("least needs background, the class that it counts against"));
    }
    if !matches!(vote, None | Some("mean" | "majority")) {
        let vote = vote.unwrap_or_default();
        return Err(value_error(format!("vote must be majority or mean, not {vote}")));
    }
    let rule = |labels: &[String]| match (vote, background) {
        (None, _) => Ok(None),
        (Some("mean"), _) => Ok(Some(VotingRule::Mean)),
        (Some(_), None) => Ok(Some(VotingRule::Majority(None))),
        (Some(_), Some(label)) => {
            let labels = Labels::new(labels.to_vec()).map_err(|e| e.to_string())?;
            VotingRule::majority_over(label, least, &labels).map(Some).map_err(|e| e.to_string())
        }
    };
    let averaged = paths.len() != 1 || weights.is_some();
    if averaged && background.is_some() {
        return Err(value_error(
            "background works on the windows of one file: it cannot be combined with an average of files",
        ));
    }
    let fused = compute(py, || fused::fuse(&paths, rule, weights.as_deref()))?;
    let fused = fused.map_err(value_error)?;
    Ok((csv(fused.table.to_csv())?, fused.warnings))
}

/// McNemar's test and bootstrap intervals, as JSON.
#[pyfunction]
pub(crate) fn compare_predictions(
    py: Python<'_>,
    first: PathBuf,
    second: PathBuf,
    target: Option<&str>,
    groups: Option<&str>,
    resamples: usize,
    seed: u64,
) -> PyResult<String> {
    let report = compute(py, || {
        let (first, second) = (PredictionTable::read(&first)?, PredictionTable::read(&second)?);
        compare(&first, &second, (target, groups), resamples, seed)
    })?;
    serde_json::to_string(&report.map_err(value_error)?).map_err(value_error)
}

/// Scores of a prediction file, as JSON.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "one private caller, by name")]
pub(crate) fn score(
    py: Python<'_>,
    predictions: PathBuf,
    labels: LabelArguments,
    target: Option<String>,
    groups: Option<String>,
    reject: f64,
    numeric: bool,
    resamples: usize,
    seed: u64,
) -> PyResult<String> {
    let source = labels.source();
    let mut scoring = Scoring { target, groups, reject, numeric, draws: resamples, seed };
    let report = compute(py, || {
        let mut table = PredictionTable::read(&predictions)?;
        if let Some(source) = &source {
            let (target, groups) = (scoring.target.as_deref(), scoring.groups.as_deref());
            scoring.target = table.add_labels(source, target, groups)?;
        }
        table.score(&scoring)
    })?;
    serde_json::to_string(&report.map_err(value_error)?).map_err(value_error)
}

pub(crate) fn csv(bytes: std::io::Result<Vec<u8>>) -> PyResult<String> {
    String::from_utf8(bytes.map_err(value_error)?).map_err(value_error)
}
