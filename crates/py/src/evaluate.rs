//! Scores of a CORSMAL submission.

use std::path::PathBuf;

use corsmal_ccm::dataset::Annotations;
use corsmal_ccm::scores::{RuleSet, evaluate as ccm_evaluate};
use corsmal_ccm::submission::{Submission, stand_in};
use pyo3::prelude::*;

use crate::errors::value_error;
use crate::pool::compute;

pub(crate) type Scored = (Vec<(&'static str, f64)>, usize, Vec<String>);

/// Scores by name, recordings scored, notes. Tasks that are not addressed are taken from `baseline`,
/// by default the official stand-in, or from pseudo-random estimates of `seed`, in the filling mass.
#[pyfunction]
pub(crate) fn evaluate(
    py: Python<'_>,
    submission: PathBuf,
    annotations: PathBuf,
    rules: &str,
    baseline: Option<PathBuf>,
    seed: Option<u64>,
    containers: Option<Vec<u8>>,
) -> PyResult<Scored> {
    let rules = RuleSet::ALL.into_iter().find(|set| set.name() == rules).ok_or_else(|| {
        let names = RuleSet::ALL.map(RuleSet::name).join(", ");
        value_error(format!("rules must be one of {names}, not {rules}"))
    })?;
    let scores = compute(py, || {
        let submission = Submission::read(&submission)?;
        let annotations = Annotations::read(&annotations)?;
        let baseline = match baseline {
            Some(path) => Submission::read(&path)?,
            None => stand_in(&submission, &annotations, rules, seed)?,
        };
        ccm_evaluate(&submission, &annotations, &baseline, rules, containers.as_deref())
    })?
    .map_err(value_error)?;
    Ok((scores.values, scores.rows, scores.notes))
}
