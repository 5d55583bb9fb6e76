//! M2's network with its numbers, and its file.

use std::collections::HashMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::estimate::millilitres_of;
use crate::error::{NetError, Result};
use crate::history::History;
use crate::network::Network;
use crate::networks;
use crate::recipe::Recipe;
use crate::weights::{self, State, WeightsError};

/// Text entry of a model's file.
const ENTRY: &str = "corsmal-feat-capacity";
/// Version of that entry.
pub(super) const FORMAT: u32 = 1;

/// What a model's file says about its network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// version of this entry
    pub format: u32,
    /// name in the registry
    pub network: String,
    /// how it was trained
    pub recipe: Recipe,
    /// what became of the training; scores are those of the examples held out
    pub history: History,
    /// what it was learned from
    pub provenance: Value,
    /// version of the program that wrote it
    pub tool_version: String,
}

/// M2's network with its numbers.
#[derive(Debug)]
pub struct CapacityNetwork {
    /// the network
    pub(super) network: Network,
    /// what its training left; `None` for weights alone
    pub header: Option<Header>,
}

impl CapacityNetwork {
    /// Reads the published weights, others under the same names (`.pth`, `.npz`, `.safetensors`), or what
    /// [`train`](super::train) learned.
    ///
    /// # Errors
    /// [`WeightsError`] for files that cannot be read or hold another network's weights.
    pub fn read(path: &Path) -> std::result::Result<Self, WeightsError> {
        if let Ok(Some(_)) = weights::safetensors_text(&weights::bytes(path)?, ENTRY) {
            return Self::read_model(path);
        }
        let state = weights::read(path)?;
        let refuse = |e: NetError| WeightsError::Content {
            path: path.into(),
            reason: format!("not the weights of M2's capacity network: {e}"),
        };
        Ok(Self { network: loaded(&state).map_err(refuse)?, header: None })
    }

    /// Reads what [`train`](super::train) learned, and no weights alone.
    ///
    /// # Errors
    /// [`WeightsError`] for files that cannot be read or are no such model.
    pub fn read_model(path: &Path) -> std::result::Result<Self, WeightsError> {
        let refuse = |reason: String| WeightsError::Content { path: path.into(), reason };
        Self::from_bytes(&weights::bytes(path)?).map_err(refuse)
    }

    fn from_bytes(bytes: &[u8]) -> std::result::Result<Self, String> {
        let no_model = |why: &str| {
            format!(
                "not a model of M2's capacity network ({why}); `capacity train --method m2` makes \
                 one"
            )
        };
        let (header, seal): (Header, _) =
            weights::entry(bytes, ENTRY, FORMAT).map_err(|e| no_model(&e))?.ok_or_else(|| {
                no_model("its recipe is missing; use --weights for weights without a recipe")
            })?;
        header.recipe.check().map_err(|e| e.to_string())?;
        let state = weights::from_safetensors(bytes)?;
        seal.check(weights::numbers(&state))?;
        let network = loaded(&state).map_err(|e| no_model(&e.to_string()))?;
        if header.network != network.name() {
            return Err(no_model(&format!("it names the network {}", header.network)));
        }
        Ok(Self { network, header: Some(header) })
    }

    /// The bytes of a model's file, or of weights alone: the same for the same training on any
    /// number of threads.
    ///
    /// # Errors
    /// A text.
    pub fn to_bytes(&self) -> std::result::Result<Vec<u8>, String> {
        let all = self.network.parameters().iter();
        let state: State =
            all.map(|(d, v)| (d.name.clone(), d.shape.clone(), v.to_vec())).collect();
        let text =
            self.header.as_ref().map(|header| weights::sealed(header, &state)).transpose()?;
        weights::to_safetensors(&state, text.map(|t| HashMap::from([(ENTRY.to_owned(), t)])))
    }

    /// Capacity in mL. `depth` is the region's depth over 700 mm, resized to 112 by 112, row by row; `size` its
    /// height over 720 px and width over 1280 px.
    ///
    /// # Errors
    /// [`NetError`] for another number of values, or values that are not finite.
    pub fn millilitres(&self, depth: &[f32], size: [f32; 2]) -> Result<f64> {
        millilitres_of(&self.network, depth, size)
    }
}

/// The network with these numbers.
fn loaded(state: &State) -> Result<Network> {
    let mut network = networks::named("m2_capacity")?.build(None, 0)?;
    network.load_state(state)?;
    if let Some((name, value)) = network.parameters().not_finite() {
        return Err(NetError::Targets(format!("{name} holds {value}")));
    }
    Ok(network)
}
