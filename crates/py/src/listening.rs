//! Networks that learn from recordings, hear and embed them.

use std::path::{Path, PathBuf};

use corsmal_extract::inputs::{self, Input};
use corsmal_models::validation;
use corsmal_models::voting::VotingRule;
use corsmal_nets::device::Device;
use corsmal_nets::networks;
use corsmal_systems::SystemError;
use corsmal_systems::embedding::Embedder;
use corsmal_systems::examples::Examples;
use corsmal_systems::listening::{Formats, Listener};
use corsmal_systems::training::Training;
use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::errors::{run_error, value_error};
use crate::extract::{input_error, interruptible};
use crate::nets::PyTrainedNetwork;
use crate::pool::{compute, jobs as usual_jobs};
use crate::scoring::csv;
use crate::teller::Teller;

/// Columns of labels and groups.
const TARGET: &str = "y";
const GROUPS: &str = "groups";

/// Recordings that gave nothing: name and reason.
type Failed = Vec<(String, String)>;

/// By id the rows of a recording [rows, numbers].
type Embedded<'py> = Vec<(String, Bound<'py, PyArrayDyn<f32>>)>;

fn error(error: SystemError) -> PyErr {
    match error {
        SystemError::Interrupted => PyKeyboardInterrupt::new_err(error.to_string()),
        SystemError::Extraction(error) => run_error(&error),
        error => value_error(error),
    }
}

fn threads(jobs: Option<usize>) -> PyResult<usize> {
    jobs.map_or_else(usual_jobs, Ok)
}

/// One recording for each path.
fn recordings(paths: &[String]) -> PyResult<Vec<Input>> {
    let found = inputs::collect(paths).map_err(input_error)?.inputs;
    // By number alone a folder of two and a file that is skipped would pass.
    let same = |(input, path): (&Input, &String)| input.source.to_string() == *path;
    if found.len() == paths.len() && found.iter().zip(paths).all(same) {
        return Ok(found);
    }
    let (found, named) = (found.len(), paths.len());
    Err(value_error(format!(
        "{named} paths mean {found} recordings: folders, globs and manifests have no labels here; \
         name each recording"
    )))
}

/// A recording: path, label, group.
type Row = (String, String, Option<String>);

/// Items of recordings with their labels, and the recordings that were left out.
fn examples(
    py: Python<'_>,
    name: &str,
    rows: &[Row],
    jobs: Option<usize>,
) -> PyResult<(Examples, Failed)> {
    let definition = networks::classifier(name).map_err(value_error)?;
    let jobs = threads(jobs)?;
    let mut left_out = Vec::new();
    let examples = py.detach(|| {
        interruptible(
            |stop| {
                let paths: Vec<String> = rows.iter().map(|(path, ..)| path.clone()).collect();
                let mut found = recordings(&paths)?;
                for (input, (_, label, group)) in found.iter_mut().zip(rows) {
                    let group = group.as_ref().map(|group| (GROUPS.into(), group.clone()));
                    let labels = std::iter::once((TARGET.into(), label.clone())).chain(group);
                    input.labels = labels.collect();
                }
                let place = (Path::new("the recordings"), &found[..]);
                Examples::of_recordings(definition, place, jobs, stop, |input, reason| {
                    left_out.push((input.id.clone(), reason.to_owned()));
                })
                .map_err(error)
            },
            &mut |_| Ok(()),
        )
    })?;
    Ok((examples, left_out))
}

/// What is learned of rows by a recipe.
fn training<'t>(
    rows: &[Row],
    recipe: &str,
    checkpoints: Option<&'t Path>,
) -> PyResult<Training<'t>> {
    let recipe = serde_json::from_str(recipe).map_err(value_error)?;
    let groups = rows.iter().any(|(.., group)| group.is_some()).then_some(GROUPS);
    Ok(Training { target: TARGET, groups, recipe, checkpoints, weights: None, device: Device::Cpu })
}

/// A network trained on recordings, what is odd about them, and those that were left out; `kind` is what the labels
/// are in numpy.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one private caller, by name")]
pub(crate) fn train_network(
    py: Python<'_>,
    name: &str,
    rows: Vec<Row>,
    kind: &str,
    recipe: &str,
    checkpoints: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
    jobs: Option<usize>,
) -> PyResult<(PyTrainedNetwork, Vec<String>, Failed)> {
    let training = training(&rows, recipe, checkpoints.as_deref())?;
    let (examples, left_out) = examples(py, name, &rows, jobs)?;
    let mut teller = Teller::new(progress);
    let trained = compute(py, || {
        training.train(&examples, serde_json::Value::Null, |told| teller.tell(told))
    })?;
    teller.end()?;
    let mut model = trained.map_err(error)?.model;
    model.header.provenance["label_kind"] = kind.into();
    let odd = training.unheeded().map(str::to_owned).into_iter().chain(examples.doubt());
    Ok((PyTrainedNetwork(model), odd.collect(), left_out))
}

/// Scores of a network on recordings that it was not trained on: the report as JSON, the predictions
/// of the held-out recordings as CSV, what is odd, and the recordings that were left out.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one private caller, by name")]
pub(crate) fn cross_validate_network(
    py: Python<'_>,
    name: &str,
    rows: Vec<Row>,
    recipe: &str,
    cv: Option<&str>,
    seed: u32,
    checkpoints: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
    jobs: Option<usize>,
) -> PyResult<(String, String, Vec<String>, Failed)> {
    let plan = cv.map(str::parse).transpose().map_err(|e| value_error(format!("cv = {e}")))?;
    let training = training(&rows, recipe, checkpoints.as_deref())?;
    let (examples, left_out) = examples(py, name, &rows, jobs)?;
    let (folds, mut warnings) = training.folds(&examples, plan.as_ref(), seed).map_err(error)?;
    let mut teller = Teller::new(progress);
    let validated =
        compute(py, || training.cross_validate(&examples, folds, |_, told| teller.tell(told)))?;
    teller.end()?;
    let validated = validated.map_err(error)?;
    warnings.extend(validated.caution.map(String::from));
    warnings.extend(examples.doubt());
    let held_out = Path::new("the held-out predictions");
    let predictions = validated.predictions(&examples.table.ids, held_out);
    let scores = compute(py, || validation::held_out(&predictions))?.map_err(value_error)?;
    let report = validated.to_value(&scores).to_string();
    Ok((report, csv(predictions.to_csv())?, warnings, left_out))
}

/// Probabilities [recordings, classes] that a network gives recordings, the mean of their windows, why
/// others have none (these are zero), and a warning about their lengths.
#[pyfunction]
pub(crate) fn hear_recordings<'py>(
    py: Python<'py>,
    network: &PyTrainedNetwork,
    paths: Vec<String>,
    any_rate: bool,
    jobs: Option<usize>,
) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Failed, Option<String>)> {
    let jobs = threads(jobs)?;
    let formats = if any_rate { Formats::Any } else { Formats::AsTrained };
    let classes = network.0.header.labels.len();
    let (mut proba, mut failed, mut unlike) = (Vec::new(), Vec::new(), Vec::new());
    let warning = py.detach(|| {
        interruptible(
            |stop| {
                let listener = Listener::new(&network.0, &[], formats, jobs).map_err(error)?;
                let found = recordings(&paths)?;
                let vote = Some(VotingRule::Mean);
                let ended = listener.recordings(&found, vote, stop, &mut |input, verdict| {
                    unlike.extend(verdict.unlike.map(|s| (input.source.to_string(), s)));
                    let found = verdict.decision.and_then(|(_, proba)| proba);
                    if found.is_none() {
                        let reason = verdict.reason.unwrap_or_default();
                        let reason = format!("{}: {reason}", verdict.status);
                        failed.push((input.source.to_string(), reason));
                    }
                    proba.extend(found.unwrap_or_else(|| vec![0.0; classes]));
                    Ok::<_, SystemError>(true)
                });
                match ended.map_err(error)? {
                    true => Ok(listener.length_warning(&unlike)),
                    false => Err(error(SystemError::Interrupted)),
                }
            },
            &mut |_| Ok(()),
        )
    })?;
    Ok((proba.into_pyarray(py).reshape(vec![paths.len(), classes])?, failed, warning))
}

/// What a network makes of recordings: by id rows of numbers, and why others have none.
#[pyfunction]
pub(crate) fn embed_recordings<'py>(
    py: Python<'py>,
    name: &str,
    paths: Vec<String>,
    weights: PathBuf,
    jobs: Option<usize>,
) -> PyResult<(Embedded<'py>, Failed)> {
    let jobs = threads(jobs)?;
    let mut failed = Vec::new();
    let (width, dataset) = py.detach(|| {
        interruptible(
            |stop| {
                let embedder = Embedder::new(name, &weights).map_err(error)?;
                let found = inputs::collect_until(&paths, stop).map_err(input_error)?;
                let tell = |input: &Input, status, reason: &str| {
                    failed.push((input.source.to_string(), format!("{status}: {reason}")));
                };
                let dataset = embedder.embed(&found.inputs, jobs, stop, tell).map_err(error)?;
                Ok((embedder.width(), dataset))
            },
            &mut |_| Ok(()),
        )
    })?;
    let column = &dataset.items.columns[0];
    let rows = dataset.ids.into_iter().zip(column.offsets.windows(2)).map(|(id, ends)| {
        let values = column.values[ends[0]..ends[1]].to_vec();
        let shape = vec![values.len() / width, width];
        Ok((id, values.into_pyarray(py).reshape(shape)?))
    });
    Ok((rows.collect::<PyResult<_>>()?, failed))
}
