//! Trained models.

use std::path::PathBuf;

use corsmal_models::labels::Labels;
use corsmal_models::model_file::{Model, ModelHeader};
use corsmal_models::pipeline::PipelineSpec;
use numpy::{IntoPyArray, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::{into_numpy, view2};
use crate::errors::{model_error, value_error};
use crate::pool::compute;

/// A trained model, of any classifier, as it is kept in a file.
#[pyclass(frozen, name = "TrainedModel", module = "corsmal_feat._core")]
pub(crate) struct PyModel(Model);

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
    /// Trains the pipeline given as JSON on `x` [rows, features] and class indices `y`.
    #[staticmethod]
    #[pyo3(signature = (pipeline, x, y, labels, target, feature_names, provenance))]
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
    ) -> PyResult<Self> {
        let spec: PipelineSpec = serde_json::from_str(pipeline).map_err(value_error)?;
        let labels = Labels::new(labels).map_err(value_error)?;
        let provenance = serde_json::from_str(provenance).map_err(value_error)?;
        let x = view2(&x)?;
        let fitted = compute(py, || spec.train(x, &y, labels.len()))?.map_err(value_error)?;
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

    /// Writes the model file, whole or not at all.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let bytes = self.0.to_bytes().map_err(model_error)?;
        corsmal_files::draft::write(&path, &bytes).map_err(model_error)
    }

    /// Reads a model file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Model::load(&path).map(Self).map_err(model_error)
    }
}
