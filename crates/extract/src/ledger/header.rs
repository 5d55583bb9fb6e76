//! Which run a ledger belongs to.

use std::path::Path;

use corsmal_files::provenance::Provenance;
use serde::{Deserialize, Serialize};

use super::error::LedgerError;

/// Layout of the ledger; a run continues only ledgers of its own. 1 had no check sums.
pub const VERSION: u32 = 2;

/// First line of a ledger: which run it belongs to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// [`VERSION`].
    pub ledger_version: u32,
    /// Version of the tool.
    pub tool_version: String,
    /// Hash of the effective configuration.
    pub config_hash: String,
    /// [`crate::inputs::list_hash`] of all inputs, before sharding.
    pub inputs_hash: String,
    /// The shard as `i/n`; `0/1` is the whole list.
    pub shard: String,
    /// Kind and compression of the output, as `npz stored`.
    pub format: String,
}

impl Header {
    /// The run that makes an output of this provenance in this format.
    pub fn new(provenance: &Provenance, format: impl std::fmt::Display) -> Self {
        Self {
            ledger_version: VERSION,
            tool_version: provenance.tool_version.clone(),
            config_hash: provenance.config_hash.clone(),
            inputs_hash: provenance.inputs_hash.clone(),
            shard: provenance.shard.clone(),
            format: format.to_string(),
        }
    }

    fn fields(&self) -> [(&'static str, String); 6] {
        [
            ("ledger version", self.ledger_version.to_string()),
            ("tool version", self.tool_version.clone()),
            ("configuration", self.config_hash.clone()),
            (
                "a list of inputs (ids, paths, times, labels) with the hash",
                self.inputs_hash.clone(),
            ),
            ("shard", self.shard.clone()),
            ("format", self.format.clone()),
        ]
    }

    /// Whether a ledger with the header `found` is of this run.
    pub(super) fn check(&self, found: &Self, path: &Path) -> Result<(), LedgerError> {
        for ((field, expected), (_, found)) in self.fields().into_iter().zip(found.fields()) {
            if expected != found {
                return Err(LedgerError::Differs { path: path.into(), field, found, expected });
            }
        }
        Ok(())
    }
}
