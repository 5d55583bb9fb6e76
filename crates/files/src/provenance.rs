//! What an output says about how it was made.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::shard::Shard;

/// Version of the layout in `docs/file-formats.md`.
pub const LAYOUT_VERSION: u32 = 1;

/// Which part of a partitioned output a file is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// The label.
    pub label: String,
    /// Its value.
    pub value: String,
    /// Where the label stands among the label columns of the run, from 0.
    pub column: usize,
    /// Inputs of the run.
    pub inputs: usize,
    /// The place of each outcome among the inputs of the run, from 0.
    pub places: Vec<usize>,
}

/// Stored in every output; equal runs have equal provenance.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// [`LAYOUT_VERSION`] of the writer.
    pub layout_version: u32,
    /// Version of the tool.
    pub tool_version: String,
    /// Hash of the effective configuration.
    pub config_hash: String,
    /// A hash of the list of all inputs, before sharding.
    pub inputs_hash: String,
    /// Which part of the inputs the output covers, `0/1` being all.
    pub shard: String,
    /// Which part of a partitioned output the file is, where that is in several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<Part>,
    /// The effective configuration as canonical JSON; kept in a place of its own.
    #[serde(skip)]
    pub config: String,
}

impl Provenance {
    /// Provenance of a run with this version of the tool.
    pub fn new(config: String, config_hash: String, inputs_hash: String, shard: Shard) -> Self {
        Self {
            layout_version: LAYOUT_VERSION,
            tool_version: env!("CARGO_PKG_VERSION").to_string(),
            config_hash,
            inputs_hash,
            shard: shard.to_string(),
            part: None,
            config,
        }
    }

    /// Names of the features in the configuration, in its order.
    pub fn features(&self) -> Vec<String> {
        let config: Value = serde_json::from_str(&self.config).unwrap_or_default();
        config["features"].as_object().map(|f| f.keys().cloned().collect()).unwrap_or_default()
    }
}
