//! What this program says in a text entry of a safetensors file about the training that made it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use corsmal_files::sealed::Seal;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::numbers::State;
use super::safetensors::{safetensors_text, safetensors_texts};
use super::seal::numbers;

/// How the names of our entries begin.
const OURS: &str = "corsmal-feat";
/// Longest header of a safetensors file.
const MAX_HEADER: u64 = 100_000_000;

/// The entry of this name and version from a file's bytes, and its seal; `None` where there is none of the name.
///
/// # Errors
/// A text when it is no safetensors file, or the entry is of another version or form.
pub(crate) fn entry<T: DeserializeOwned>(
    bytes: &[u8],
    name: &str,
    version: u32,
) -> Result<Option<(T, Seal)>, String> {
    let Some(text) = safetensors_text(bytes, name)? else { return Ok(None) };
    let mut value: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let format = value.get("format").and_then(Value::as_u64);
    if format != Some(version.into()) {
        let found = format.map_or("none".into(), |f| f.to_string());
        return Err(format!("format version {found}: this program reads version {version}"));
    }
    let seal = Seal::take(&mut value);
    let entry = serde_json::from_value(value).map_err(|e| e.to_string())?;
    Ok(Some((entry, seal)))
}

/// Refuses numbers of a file's bytes that are not those that this program wrote there.
///
/// # Errors
/// A text.
pub(super) fn check_ours(bytes: &[u8], state: &State) -> Result<(), String> {
    for (_, text) in safetensors_texts(bytes)?.iter().filter(|(name, _)| name.starts_with(OURS)) {
        let mut entry: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
        Seal::take(&mut entry).check(numbers(state))?;
    }
    Ok(())
}

/// Whether a training of this program made a file: a network, a capacity network or a checkpoint. Its numbers
/// are not read.
pub fn trained_here(path: &Path) -> bool {
    let texts = || -> Option<Value> {
        let mut file = File::open(path).ok()?;
        let mut length = [0; 8];
        file.read_exact(&mut length).ok()?;
        let length = u64::from_le_bytes(length);
        let mut header = Vec::new();
        file.take(length.min(MAX_HEADER)).read_to_end(&mut header).ok()?;
        let header: Value = serde_json::from_slice(&header).ok()?;
        header.get("__metadata__").cloned()
    };
    let texts = texts();
    let texts = texts.as_ref().and_then(Value::as_object);
    texts.is_some_and(|texts| texts.keys().any(|name| name.starts_with(OURS)))
}
