//! A hash in a text entry, of the entry and of the numbers beside it: damaged files are not believed.

use serde::Serialize;
use serde_json::Value;

use super::numbers::State;

/// Its key in the entry.
const HASH: &str = "hash";

/// The text of an entry about these numbers, with the hash.
///
/// # Errors
/// A text when the entry is no JSON object.
pub(crate) fn sealed(entry: &impl Serialize, state: &State) -> Result<String, String> {
    let mut value = serde_json::to_value(entry).map_err(|e| e.to_string())?;
    let hash = hash_of(&value, state);
    value.as_object_mut().ok_or("no JSON object")?.insert(HASH.into(), hash.into());
    Ok(value.to_string())
}

/// The hash that a file has, and what it is of.
pub(crate) struct Seal {
    /// absent in files of version 0.1.0
    hash: Option<Value>,
    entry: Value,
}

impl Seal {
    /// Takes the hash out of an entry.
    pub fn take(entry: &mut Value) -> Self {
        let hash = entry.as_object_mut().and_then(|entry| entry.shift_remove(HASH));
        Self { hash, entry: entry.clone() }
    }

    /// Refuses other numbers, or another entry, than were written.
    ///
    /// # Errors
    /// A text.
    pub fn check(&self, state: &State) -> Result<(), String> {
        match &self.hash {
            Some(hash) if *hash != hash_of(&self.entry, state) => {
                Err("damaged: its content does not match the hash written with it".into())
            }
            _ => Ok(()),
        }
    }
}

/// The numbers may be in any order.
fn hash_of(entry: &Value, state: &State) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(entry.to_string().as_bytes());
    let mut parts: Vec<_> = state.iter().collect();
    parts.sort_unstable_by_key(|(name, ..)| name);
    for (name, shape, values) in parts {
        hash.update(format!("/{name} {shape:?}").as_bytes());
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        hash.update(&bytes);
    }
    hash.finalize().to_hex().to_string()
}
