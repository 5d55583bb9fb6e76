//! The key `librosa`: one switch for the conventions of a librosa.
//!
//! `librosa = "0.8"` (or `--set librosa=0.8`) makes every value that differs between versions the one
//! that was the default then: `signal.res_type`, `pad_mode` of each feature, and `librosa` of the
//! compound features whose originals changed in more than that. It fills in what a configuration
//! leaves open, refuses what it spells out as the other version's, and is gone after that: outputs store the values themselves, so that a configuration
//! with the switch and one that spells them out have the same hash, and a new feature takes part by
//! having such a key.

use corsmal_dsp::librosa::LibrosaVersion;
use serde_json::{Map, Value, json};

use crate::features;
use crate::params::ConfigError;

/// Resolves the key in a configuration tree.
pub fn resolve(tree: &mut Value) -> Result<(), ConfigError> {
    let Some(object) = tree.as_object_mut() else { return Ok(()) };
    let Some(value) = object.remove("librosa") else { return Ok(()) };
    // TOML and --set may give a number.
    let name = value.as_str().map_or_else(|| value.to_string(), str::to_string);
    let version: LibrosaVersion = serde_json::from_value(Value::String(name)).map_err(|_| {
        ConfigError::key("librosa", format!("must be \"0.8\" or \"0.11\", not {value}"))
    })?;
    if let Some(signal) = object.entry("signal").or_insert_with(|| json!({})).as_object_mut() {
        let of = |v: LibrosaVersion| json!(v.res_type());
        fill(signal, "signal.res_type", version, of)?;
    }
    let Some(configured) = object.get_mut("features").and_then(Value::as_object_mut) else {
        return Ok(());
    };
    for (name, feature) in configured {
        let Some(table) = feature.as_object_mut() else { continue };
        let kind = table.get("kind").and_then(Value::as_str).unwrap_or(name);
        let Some(entry) = features::find(kind) else { continue };
        let known = entry.defaults();
        if known.get("pad_mode").is_some() {
            let key = format!("features.{name}.pad_mode");
            fill(table, &key, version, |v| json!(v.pad_mode()))?;
        }
        if known.get("librosa").is_some() {
            fill(table, &format!("features.{name}.librosa"), version, |v| json!(v))?;
        }
    }
    Ok(())
}

/// Puts the value `of` a version under the last part of `key`, if nothing is there.
fn fill(
    table: &mut Map<String, Value>,
    key: &str,
    version: LibrosaVersion,
    of: impl Fn(LibrosaVersion) -> Value,
) -> Result<(), ConfigError> {
    let last = key.rsplit('.').next().unwrap_or(key);
    let own = table.entry(last).or_insert_with(|| of(version));
    let other = version.other();
    if *own == of(other) {
        let (own, version, other) = (&*own, json!(version), json!(other));
        let message = format!(
            "{own} is the value of librosa {other}, but the configuration has librosa = {version}: remove one of the two keys"
        );
        return Err(ConfigError::key(key, message));
    }
    Ok(())
}
