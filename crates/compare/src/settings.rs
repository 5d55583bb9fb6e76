//! Configurations of two outputs of ours, key by key.

use serde::Serialize;

use corsmal_files::provenance::Provenance;
use corsmal_files::settings::{Setting, differing};

use super::texts::TextReport;

/// How the configurations of two outputs differ.
#[derive(Debug, Serialize)]
pub struct Settings {
    /// Hash of the first.
    pub hash_a: String,
    /// Hash of the second.
    pub hash_b: String,
    /// Whether both are over the same list of inputs.
    pub same_inputs: bool,
    /// Identities of the files of the recordings that both have.
    pub contents: TextReport,
    /// Keys that differ.
    pub differences: Vec<Setting>,
}

impl Settings {
    /// Compares what two outputs say about themselves.
    pub(super) fn new(a: &Provenance, b: &Provenance, contents: TextReport) -> Self {
        Self {
            hash_a: a.config_hash.clone(),
            hash_b: b.config_hash.clone(),
            same_inputs: a.inputs_hash == b.inputs_hash,
            contents,
            differences: differing(&a.config, &b.config),
        }
    }
}
