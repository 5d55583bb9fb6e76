//! Configurations of two outputs of ours, key by key.

use serde::Serialize;
use serde_json::Value;

use corsmal_files::provenance::Provenance;

/// How the configurations of two outputs differ.
#[derive(Debug, Serialize)]
pub struct Settings {
    /// Hash of the first.
    pub hash_a: String,
    /// Hash of the second.
    pub hash_b: String,
    /// Whether both are over the same list of inputs.
    pub same_inputs: bool,
    /// Keys that differ.
    pub differences: Vec<Setting>,
}

/// A key that differs.
#[derive(Debug, Serialize)]
pub struct Setting {
    /// Dotted path.
    pub key: String,
    /// Its value in the first file; `None` where the key is absent.
    pub a: Option<Value>,
    /// Its value in the second.
    pub b: Option<Value>,
}

impl Settings {
    /// Compares what two outputs say about themselves.
    pub(super) fn new(a: &Provenance, b: &Provenance) -> Self {
        let (keys_a, keys_b) = (flattened(&a.config), flattened(&b.config));
        let value = |keys: &[(String, Value)], key: &str| {
            keys.iter().find(|(other, _)| other == key).map(|(_, value)| value.clone())
        };
        let only_b = keys_b.iter().filter(|(key, _)| value(&keys_a, key).is_none());
        let differences = keys_a
            .iter()
            .chain(only_b)
            .map(|(key, _)| Setting {
                key: key.clone(),
                a: value(&keys_a, key),
                b: value(&keys_b, key),
            })
            .filter(|setting| setting.a != setting.b)
            .collect();
        Self {
            hash_a: a.config_hash.clone(),
            hash_b: b.config_hash.clone(),
            same_inputs: a.inputs_hash == b.inputs_hash,
            differences,
        }
    }
}

/// Every setting with its dotted path. Text that is not JSON has none: the hash tells them apart.
fn flattened(config: &str) -> Vec<(String, Value)> {
    let mut keys = Vec::new();
    if let Ok(value) = serde_json::from_str(config) {
        flatten(String::new(), value, &mut keys);
    }
    keys
}

fn flatten(path: String, value: Value, keys: &mut Vec<(String, Value)>) {
    match value {
        Value::Object(table) => {
            for (name, value) in table {
                let path = if path.is_empty() { name } else { format!("{path}.{name}") };
                flatten(path, value, keys);
            }
        }
        value => keys.push((path, value)),
    }
}
