//! Text entries whose hash covers the numbers beside them.

use corsmal_files::sealed;
use serde::Serialize;

use super::numbers::State;

/// The text of an entry about these numbers, with the hash.
///
/// # Errors
/// A text when the entry is no JSON object.
pub(crate) fn sealed(entry: &impl Serialize, state: &State) -> Result<String, String> {
    let mut value = serde_json::to_value(entry).map_err(|e| e.to_string())?;
    sealed::seal(&mut value, numbers(state))?;
    Ok(value.to_string())
}

/// Adds numbers to a hash, in whatever order they lie in the file.
pub(crate) fn numbers(state: &State) -> impl FnOnce(&mut blake3::Hasher) {
    |hash| {
        let mut parts: Vec<_> = state.iter().collect();
        parts.sort_unstable_by_key(|(name, ..)| name);
        for (name, shape, values) in parts {
            hash.update(format!("/{name} {shape:?}").as_bytes());
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            hash.update(&bytes);
        }
    }
}
