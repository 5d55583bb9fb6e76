//! Trained models.

use std::path::PathBuf;

use corsmal_models::labels::Labels;
use corsmal_models::model_file::{Lengths, Model, ModelHeader, TrainedOn};
use corsmal_models::pipeline::PipelineSpec;
use numpy::{IntoPyArray, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Deserialize;

use crate::arrays::{into_numpy, view2};
use crate::errors::{model_error, value_error};
use crate::pool::compute;

/// A trained model, of any classifier, as it is kept in a file.
#[pyclass(frozen, name = "TrainedModel", module = "corsmal_feat._core")]
pub(crate) struct PyModel(Model);

/// Numbers that are taken; None for any.
type Taken = Option<Vec<u32>>;

/// How the rows of a table were made.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MadeOf {
    feature_names: Vec<String>,
    feature_config: serde_json::Value,
    feature_config_hash: String,
    /// sample rate and channels of each recording
    formats: Vec<(Option<u32>, Option<u32>)>,
    /// length of each recording in seconds, as far as it is known
    seconds: Vec<f64>,
}

/// The classifier's parameters with all defaults, as JSON: refuses names and values as training
/// would.
#[pyfunction]
pub(crate) fn classifier_parameters(name: &str, parameters: &str) -> PyResult<String> {
    let object = serde_json::from_str(parameters).map_err(value_error)?;
    let spec =
        corsmal_models::classifiers::ClassifierSpec::new(name, &object).map_err(value_error)?;
    serde_json::to_string(&spec.parameters()).map_err(value_error)
}

#[pymethods]
impl PyModel {
    /// Trains the pipeline given as JSON on `x` [rows, features] and class indices `y`; with
    /// `weights`, rows count more or less.
    #[staticmethod]
    #[pyo3(signature = (pipeline, x, y, labels, target, feature_names, provenance, weights))]
    #[allow(clippy::too_many_arguments, reason = "one private caller, by name")]
    fn fit(
        py: Python<'_>,
        pipeline: &str,
        x: PyReadonlyArrayDyn<'_, f64>,
        y: Vec<usize>,
        labels: Vec<String>,
        target: String,
        feature_names: Vec<String>,
        provenance: &str,
        weights: Option<Vec<f64>>,
    ) -> PyResult<Self> {
        let spec: PipelineSpec = serde_json::from_str(pipeline).map_err(value_error)?;
        let labels = Labels::new(labels).map_err(value_error)?;
        let provenance = serde_json::from_str(provenance).map_err(value_error)?;
        let x = view2(&x)?;
        let train = || spec.train_weighted(x, &y, labels.len(), weights.as_deref());
        let fitted = compute(py, train)?.map_err(value_error)?;
        let header = ModelHeader {
            pipeline: spec,
            labels,
            target,
            feature_names,
            feature_config: serde_json::Value::Null,
            feature_config_hash: String::new(),
            provenance,
            trained_on: None,
            tool_version: env!("CARGO_PKG_VERSION").into(),
        };
        Model::new(header, fitted).map(Self).map_err(value_error)
    }

    /// Class indices of `x` [rows, features].
    fn predict<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let x = view2(&x)?;
        let classes = compute(py, || self.0.predict(x))?.map_err(value_error)?;
        let classes: Vec<i64> = classes.into_iter().map(|c| c as i64).collect();
        Ok(classes.into_pyarray(py).into_any())
    }

    /// Probabilities [rows, classes] of `x` [rows, features].
    fn predict_proba<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let x = view2(&x)?;
        let proba = compute(py, || self.0.predict_proba(x))?.map_err(value_error)?;
        into_numpy(py, proba)
    }

    /// Decision values [rows, classes], or [rows, 1] of two classes, of `x` [rows, features].
    fn decision_function<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let x = view2(&x)?;
        let values = compute(py, || self.0.pipeline().decision_function(x))?;
        into_numpy(py, values.map_err(value_error)?)
    }

    /// Distances and numbers [rows, k] of the training rows nearest to those of `x` [rows, features],
    /// or to each training row among the others.
    fn neighbours<'py>(
        &self,
        py: Python<'py>,
        x: Option<PyReadonlyArrayDyn<'py, f64>>,
        k: usize,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let x = x.as_ref().map(view2).transpose()?;
        let found = compute(py, || self.0.pipeline().neighbours(x, k))?.map_err(value_error)?;
        let rows = found.rows.mapv(|row| row as i64);
        Ok((into_numpy(py, found.distances)?, into_numpy(py, rows)?))
    }

    /// Importance of each feature, if it is known: right after `fit`.
    fn feature_importances<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        let importances = self.0.pipeline().classifier().feature_importances()?;
        Some(importances.to_vec().into_pyarray(py).into_any())
    }

    /// Class fractions [rows, classes] by the trees that have not seen the row, if they are known:
    /// right after `fit`.
    fn out_of_bag<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let known = self.0.pipeline().classifier().out_of_bag();
        known.map(|fractions| into_numpy(py, fractions)).transpose()
    }

    /// What the file says about the model, as JSON.
    fn header(&self) -> PyResult<String> {
        serde_json::to_string(self.0.header()).map_err(value_error)
    }

    /// Features per row.
    fn n_features(&self) -> usize {
        self.0.n_features()
    }

    /// The bytes of the model file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.0.to_bytes().map_err(model_error)?))
    }

    /// A model from the bytes of a model file.
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        Model::from_bytes(bytes).map(Self).map_err(model_error)
    }

    /// Writes the model file, whole or not at all. `features` says as JSON how its rows were made:
    /// the fields of the header that are about features.
    #[pyo3(signature = (path, features))]
    fn save(&self, path: PathBuf, features: Option<&str>) -> PyResult<()> {
        let Some(features) = features else {
            return self.0.save(&path).map_err(model_error);
        };
        let made: MadeOf = serde_json::from_str(features).map_err(value_error)?;
        let header = ModelHeader {
            feature_names: made.feature_names,
            feature_config: made.feature_config,
            feature_config_hash: made.feature_config_hash,
            trained_on: TrainedOn::of(made.formats)
                .map(|formats| TrainedOn { seconds: Lengths::of(made.seconds), ..formats }),
            ..self.0.header().clone()
        };
        let model = Model::new(header, self.0.pipeline().clone()).map_err(value_error)?;
        model.save(&path).map_err(model_error)
    }

    /// Sample rates and channel counts that recordings may have; None for any.
    fn format_rule(&self) -> PyResult<(Taken, Taken)> {
        let rule = self.0.format_rule(&self.0.header().feature_config).map_err(model_error)?;
        Ok((rule.sample_rates().map(<[u32]>::to_vec), rule.channels().map(<[u32]>::to_vec)))
    }

    /// A warning if some of these recordings, by name and seconds, are far from those learned from.
    fn length_warning(&self, recordings: Vec<(String, f64)>) -> Option<String> {
        let lengths = self.0.lengths(&self.0.header().feature_config)?;
        lengths.warning(recordings.iter().map(|(name, seconds)| (name.as_str(), *seconds)))
    }

    /// Reads a model file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Model::load(&path).map(Self).map_err(model_error)
    }
}
