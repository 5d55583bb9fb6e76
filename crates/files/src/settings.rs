//! Configurations of two outputs of ours, key by key.

use std::collections::HashMap;

use serde::Serialize;
use serde_json::Value;

/// A key in which two configurations differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Setting {
    /// Dotted path.
    pub key: String,
    /// Its value in the first; `None` where the key is absent.
    pub a: Option<Value>,
    /// Its value in the second.
    pub b: Option<Value>,
}

/// The keys in which two configurations differ, as outputs store them. Text that is not JSON has none: the
/// hash tells them apart.
pub fn differing(a: &str, b: &str) -> Vec<Setting> {
    let (in_a, in_b) = (flattened(a), flattened(b));
    let a: HashMap<String, Value> = in_a.iter().cloned().collect();
    let b: HashMap<String, Value> = in_b.iter().cloned().collect();
    let only_b = in_b.into_iter().filter(|(key, _)| !a.contains_key(key));
    let keys = in_a.into_iter().chain(only_b).map(|(key, _)| key);
    keys.map(|key| Setting { a: a.get(&key).cloned(), b: b.get(&key).cloned(), key })
        .filter(|setting| setting.a != setting.b)
        .collect()
}

/// Every setting with its dotted path.
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
