//! Networks.

use std::collections::HashMap;
use std::path::PathBuf;

use corsmal_models::scores::Scores;
use corsmal_nets::fit::{self, Task};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::model::{self, NetModel};
use corsmal_nets::optimiser::OptimiserSpec;
use corsmal_nets::recipe::Recipe;
use corsmal_nets::trainer::{StepSettings, Trainer};
use corsmal_nets::{batch, loss, network, networks, weights};
use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde::Deserialize;

use crate::errors::{model_error, value_error};
use crate::pool::compute;
use crate::teller::Teller;

/// A network with its numbers.
#[pyclass(name = "Network", module = "corsmal_feat._core")]
pub(crate) struct PyNetwork(network::Network);

/// Names and descriptions of the networks.
#[pyfunction]
pub(crate) fn networks_published() -> Vec<(&'static str, &'static str)> {
    networks::NETWORKS.iter().map(|d| (d.name, d.about)).collect()
}

/// What `train_steps` is told, in PyTorch's words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StepRecipe {
    optimizer: String,
    lr: f64,
    #[serde(default)]
    momentum: f64,
    #[serde(default)]
    weight_decay: f64,
    #[serde(default)]
    clip_grad_norm: Option<f64>,
    #[serde(default)]
    class_weights: Vec<f32>,
    #[serde(default)]
    loss: Option<String>,
}

impl StepRecipe {
    fn settings(self, dropout: Option<u64>) -> PyResult<StepSettings> {
        let Self { lr, momentum, weight_decay, .. } = self;
        let refuse = |key: &str, value: &str, allowed: &str| {
            Err(value_error(format!("recipe: {key} must be {allowed}, not {value:?}")))
        };
        let numbers = [("lr", lr), ("momentum", momentum), ("weight_decay", weight_decay)];
        for (key, value) in
            numbers.into_iter().chain(self.clip_grad_norm.map(|c| ("clip_grad_norm", c)))
        {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(key, &value.to_string(), "a finite number of at least 0");
            }
        }
        if let Some(bad) = self.class_weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
            return refuse("class_weights", &bad.to_string(), "finite numbers of at least 0");
        }
        let optimiser = match self.optimizer.as_str() {
            "sgd" => OptimiserSpec::Sgd { lr, momentum, weight_decay },
            "adam" => OptimiserSpec::Adam { lr, weight_decay },
            other => return refuse("optimizer", other, "sgd or adam"),
        };
        let loss = match self.loss.as_deref() {
            None | Some("cross_entropy") => loss::Loss::CrossEntropy,
            Some("mse") => loss::Loss::Mse,
            Some(other) => return refuse("loss", other, "cross_entropy or mse"),
        };
        let (clip_grad_norm, class_weights) = (self.clip_grad_norm, self.class_weights);
        Ok(StepSettings { optimiser, clip_grad_norm, loss, class_weights, dropout })
    }
}

type Arrays<'py> = Vec<PyReadonlyArrayDyn<'py, f32>>;

#[pymethods]
impl PyNetwork {
    /// The network of this name; `outputs` replaces its number of classes.
    #[staticmethod]
    #[pyo3(signature = (name, outputs, seed))]
    fn build(name: &str, outputs: Option<usize>, seed: u64) -> PyResult<Self> {
        let definition = networks::named(name).map_err(value_error)?;
        definition.build(outputs, seed).map(Self).map_err(value_error)
    }

    fn name(&self) -> &str {
        self.0.name()
    }

    fn num_parameters(&self) -> usize {
        self.0.parameters().count()
    }

    /// Layers with the shape after each.
    fn layers(&self) -> Vec<(String, String)> {
        self.0.describe()
    }

    /// Inputs: name and shape.
    fn inputs(&self) -> Vec<(String, String)> {
        self.0.inputs().iter().map(|i| (i.name.clone(), i.shape.to_string())).collect()
    }

    fn outputs(&self) -> usize {
        self.0.outputs()
    }

    /// All numbers under PyTorch's names.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        state(py, &self.0)
    }

    /// Replaces all numbers.
    fn load_state(&mut self, state: Vec<(String, PyReadonlyArrayDyn<'_, f32>)>) -> PyResult<()> {
        let state = state_of(&state)?;
        self.0.load_state(&state).map_err(value_error)
    }

    /// Outputs `[items, outputs]` in evaluation mode.
    fn forward<'py>(
        &self,
        py: Python<'py>,
        arrays: Arrays<'py>,
        lengths: Option<Vec<usize>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let inputs = inputs(&self.0, &arrays, lengths)?;
        let out = compute(py, || self.0.forward(&inputs))?.map_err(value_error)?;
        numpy(py, out)
    }

    /// What the last layers work on, `[items, n]`.
    fn features<'py>(
        &self,
        py: Python<'py>,
        arrays: Arrays<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let inputs = inputs(&self.0, &arrays, None)?;
        let out = compute(py, || self.0.features(&inputs))?.map_err(value_error)?;
        numpy(py, out)
    }

    /// Steps over the whole batch. Losses, and the gradients' norms at the first step. After a
    /// refusal the network is as it was before the first of them.
    #[allow(clippy::too_many_arguments, reason = "one private caller, by name")]
    fn train_steps<'py>(
        &mut self,
        py: Python<'py>,
        arrays: Arrays<'py>,
        classes: Option<Vec<usize>>,
        numbers: Option<Vec<f32>>,
        steps: usize,
        recipe: &str,
        dropout: Option<u64>,
        lengths: Option<Vec<usize>>,
    ) -> PyResult<(Vec<f64>, HashMap<String, f64>)> {
        let recipe: StepRecipe = serde_json::from_str(recipe).map_err(value_error)?;
        let settings = recipe.settings(dropout)?;
        let inputs = inputs(&self.0, &arrays, lengths)?;
        let targets = match (classes, numbers) {
            (Some(classes), _) => loss::Targets::Classes(classes),
            (None, numbers) => loss::Targets::Numbers(numbers.unwrap_or_default()),
        };
        let before = self.0.parameters().clone();
        let done = compute(py, || {
            let mut trainer = Trainer::new(&mut self.0, settings);
            let (mut losses, mut norms) = (Vec::new(), HashMap::new());
            for step in 0..steps {
                let found = trainer.step(&inputs, &targets)?;
                losses.push(found.loss);
                if step == 0 {
                    norms = found.norms;
                }
            }
            Ok::<_, corsmal_nets::NetError>((losses, norms))
        });
        if !matches!(done, Ok(Ok(_))) {
            *self.0.parameters_mut() = before;
        }
        done?.map_err(value_error)
    }
}

/// A trained network as it is kept in a file.
#[pyclass(frozen, name = "TrainedNetwork", module = "corsmal_feat._core")]
pub(crate) struct PyTrainedNetwork(pub(crate) NetModel);

/// Numbers of all items of an input, and where each begins.
type ItemColumns<'py> = Vec<(PyReadonlyArrayDyn<'py, f32>, Vec<usize>)>;

/// The recipe of a network with some keys replaced, as JSON.
#[pyfunction]
pub(crate) fn network_recipe(name: &str, changes: &str) -> PyResult<String> {
    let changes = serde_json::from_str(changes).map_err(value_error)?;
    let recipe =
        networks::named(name).and_then(|d| d.recipe_with(&changes)).map_err(value_error)?;
    serde_json::to_string(&recipe).map_err(value_error)
}

/// Name and shape of each input of a network that classifies.
#[pyfunction]
pub(crate) fn classifier_inputs(name: &str) -> PyResult<Vec<(String, String)>> {
    let inputs = networks::classifier(name).map_err(value_error)?.inputs();
    Ok(inputs.into_iter().map(|i| (i.name, i.shape.to_string())).collect())
}

#[pymethods]
impl PyTrainedNetwork {
    /// Trains on the items `train`, watching the score of the items `watched`. `progress` is told
    /// epochs done, epochs in all, last loss, last score, seconds left.
    #[staticmethod]
    #[allow(clippy::too_many_arguments, reason = "one private caller, by name")]
    fn fit(
        py: Python<'_>,
        name: &str,
        columns: ItemColumns<'_>,
        classes: Vec<usize>,
        train: Vec<usize>,
        watched: Vec<usize>,
        labels: Vec<String>,
        recipe: &str,
        checkpoint: Option<PathBuf>,
        provenance: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let recipe: Recipe = serde_json::from_str(recipe).map_err(value_error)?;
        let provenance = serde_json::from_str(provenance).map_err(value_error)?;
        let items = items(&columns)?;
        let definition = networks::classifier(name).map_err(value_error)?;
        let mut network = definition.build(Some(labels.len()), recipe.seed).map_err(value_error)?;
        let task = Task { items: &items, classes: &classes, train: &train, watched: &watched };
        let score = |truth: &[usize], found: &[usize]| {
            Scores::new(truth, found, labels.len()).map_or(0.0, |s| s.weighted_f1)
        };
        let mut teller = Teller::new(progress);
        let path = checkpoint.as_deref();
        let fitted = compute(py, || {
            fit::fit(&mut network, task, &recipe, path, score, |told| teller.tell(told))
        })?;
        teller.end()?;
        let header = model::Header {
            format: 0,
            network: definition.name.into(),
            labels,
            target: "y".into(),
            recipe,
            gpu: None,
            history: fitted.map_err(value_error)?,
            feature_config: serde_json::Value::Null,
            provenance,
            tool_version: env!("CARGO_PKG_VERSION").into(),
        };
        NetModel::new(header, network).map(Self).map_err(value_error)
    }

    /// Probabilities [items, classes].
    fn predict_proba<'py>(
        &self,
        py: Python<'py>,
        columns: ItemColumns<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let items = items(&columns)?;
        let proba = compute(py, || self.0.predict_proba(&items))?.map_err(value_error)?;
        let shape = vec![items.len(), self.0.network.outputs()];
        let flat: Vec<f64> = proba.into_iter().flatten().collect();
        flat.into_pyarray(py).reshape(shape)
    }

    /// What the file says, as JSON.
    fn header(&self) -> PyResult<String> {
        serde_json::to_string(&self.0.header).map_err(value_error)
    }

    /// All numbers under PyTorch's names.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        state(py, &self.0.network)
    }

    /// The bytes of the file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.0.to_bytes().map_err(model_error)?))
    }

    /// From the bytes of a file.
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        NetModel::from_bytes(bytes).map(Self).map_err(model_error)
    }

    /// Writes the file, whole or not at all.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let bytes = self.0.to_bytes().map_err(model_error)?;
        corsmal_files::draft::write(&path, &bytes).map_err(model_error)
    }

    /// Reads a file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        NetModel::load(&path).map(Self).map_err(model_error)
    }
}

fn items(columns: &ItemColumns<'_>) -> PyResult<Items> {
    let columns = columns
        .iter()
        .map(|(values, offsets)| {
            Ok(Column { values: values.as_slice()?.to_vec(), offsets: offsets.clone() })
        })
        .collect::<PyResult<_>>()?;
    Ok(Items { columns })
}

/// Reads weights of any kind: names and arrays.
#[pyfunction]
pub(crate) fn read_weights<'py>(py: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let state = compute(py, || weights::read(&path))?.map_err(model_error)?;
    let dict = PyDict::new(py);
    for (name, shape, values) in state {
        dict.set_item(name, values.into_pyarray(py).reshape(shape)?)?;
    }
    Ok(dict)
}

/// Writes weights, `.npz` or `.safetensors`.
#[pyfunction]
pub(crate) fn write_weights(
    path: PathBuf,
    state: Vec<(String, PyReadonlyArrayDyn<'_, f32>)>,
) -> PyResult<()> {
    weights::write(&path, &state_of(&state)?).map_err(model_error)
}

fn state_of(state: &[(String, PyReadonlyArrayDyn<'_, f32>)]) -> PyResult<weights::State> {
    state
        .iter()
        .map(|(name, array)| Ok((name.clone(), array.shape().to_vec(), array.as_slice()?.to_vec())))
        .collect()
}

fn state<'py>(py: Python<'py>, network: &network::Network) -> PyResult<Bound<'py, PyDict>> {
    let state = PyDict::new(py);
    for (declared, values) in network.parameters().iter() {
        let array = values.to_vec().into_pyarray(py).reshape(declared.shape.clone())?;
        state.set_item(&declared.name, array)?;
    }
    Ok(state)
}

fn inputs(
    network: &network::Network,
    arrays: &Arrays<'_>,
    lengths: Option<Vec<usize>>,
) -> PyResult<Vec<batch::Batch>> {
    let arrays = arrays
        .iter()
        .map(|a| Ok((a.shape().to_vec(), a.as_slice()?.to_vec())))
        .collect::<PyResult<Vec<_>>>()?;
    let mut inputs = network.batches(&arrays).map_err(value_error)?;
    if let Some(lengths) = lengths {
        inputs.iter_mut().for_each(|i| i.lengths = Some(lengths.clone()));
    }
    Ok(inputs)
}

fn numpy(py: Python<'_>, batch: batch::Batch) -> PyResult<Bound<'_, PyArrayDyn<f32>>> {
    let shape = vec![batch.items(), batch.shape.len()];
    batch.values.into_values().into_pyarray(py).reshape(shape)
}
