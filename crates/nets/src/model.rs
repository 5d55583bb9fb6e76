//! A trained network on disk: a safetensors file whose text entry says everything else.

use std::collections::HashMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::{NetError, Result};
use crate::fit::{self, History};
use crate::items::Items;
use crate::network::Network;
use crate::networks;
use crate::parameters;
use crate::recipe::Recipe;
use crate::weights::{self, State, WeightsError};

/// Text entry of the file.
const ENTRY: &str = "corsmal-feat";
/// Version of that entry.
const FORMAT: u32 = 1;

/// What the file says about its network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// version of this entry
    pub format: u32,
    /// name in the registry
    pub network: String,
    /// label names in the order of the outputs
    pub labels: Vec<String>,
    /// what is predicted
    pub target: String,
    /// how it was trained
    pub recipe: Recipe,
    /// the GPU that it was trained on; none: the processor
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gpu: Option<String>,
    /// what became of the training
    pub history: History,
    /// configuration of the features it was trained on; null when they came from elsewhere
    pub feature_config: Value,
    /// where it was learned: files, rows, folds
    pub provenance: Value,
    /// version of the program that wrote it
    pub tool_version: String,
}

/// A trained network with what is needed to use it.
#[derive(Debug)]
pub struct NetModel {
    /// what the file says
    pub header: Header,
    /// the network
    pub network: Network,
}

impl NetModel {
    /// From its parts.
    ///
    /// # Errors
    /// [`NetError::Targets`] when the labels are not as many as the outputs, or a number of the network
    /// is not finite.
    pub fn new(mut header: Header, network: Network) -> Result<Self> {
        if header.labels.len() != network.outputs() {
            let (labels, outputs) = (header.labels.len(), network.outputs());
            return Err(NetError::Targets(format!("{labels} labels for {outputs} outputs")));
        }
        if let Some((name, value)) = network.parameters().not_finite() {
            return Err(NetError::Targets(format!("{name} holds {value}: no network to keep")));
        }
        header.format = FORMAT;
        Ok(Self { header, network })
    }

    /// Probability of each class.
    ///
    /// # Errors
    /// Items that the network does not take.
    pub fn predict_proba(&self, items: &Items) -> Result<Vec<Vec<f64>>> {
        items.check(&self.network)?;
        let rows: Vec<usize> = (0..items.len()).collect();
        fit::probabilities(&self.network, items, &rows, &self.header.recipe)
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// A text.
    pub fn to_bytes(&self) -> std::result::Result<Vec<u8>, String> {
        let all = self.network.parameters().iter();
        let state: State =
            all.map(|(d, v)| (d.name.clone(), d.shape.clone(), v.to_vec())).collect();
        let header = weights::sealed(&self.header, &state)?;
        weights::to_safetensors(&state, Some(HashMap::from([(ENTRY.to_owned(), header)])))
    }

    /// From the bytes of a file, whoever wrote them.
    ///
    /// # Errors
    /// A text when it is not a trained network of ours, is damaged, or its parts do not fit.
    pub fn from_bytes(bytes: &[u8]) -> std::result::Result<Self, String> {
        let (header, seal): (Header, _) = weights::entry(bytes, ENTRY, FORMAT)?
            .ok_or("weights only: this file is not a network trained by corsmal-feat")?;
        header.recipe.check().map_err(|e| e.to_string())?;
        let definition = networks::classifier(&header.network).map_err(|e| e.to_string())?;
        // Before a network is made: a few labels too many would ask for any amount of numbers.
        let declared = definition.declared(header.labels.len()).map_err(|e| e.to_string())?;
        let shapes = weights::safetensors_shapes(bytes)?;
        let shapes = shapes.iter().map(|(name, shape)| (name.as_str(), shape.as_slice()));
        let differences = parameters::differences(&declared, shapes);
        if !differences.is_empty() {
            let network = definition.name.into();
            return Err(NetError::Weights { network, differences }.to_string());
        }
        let mut network =
            definition.build(Some(header.labels.len()), 0).map_err(|e| e.to_string())?;
        let state = weights::from_safetensors(bytes)?;
        seal.check(weights::numbers(&state))?;
        network.load_state(&state).map_err(|e| e.to_string())?;
        Self::new(header, network).map_err(|e| e.to_string())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`WeightsError`].
    pub fn load(path: &Path) -> std::result::Result<Self, WeightsError> {
        let bytes = weights::bytes(path)?;
        Self::from_bytes(&bytes)
            .map_err(|reason| WeightsError::Content { path: path.into(), reason })
    }
}
