//! The key `librosa`: one switch for the conventions of a librosa.
//!
//! `librosa = "0.8"` (or `--set librosa=0.8`) makes every value that differs between versions the one
//! that was the default then: `signal.res_type`, `pad_mode` of each feature, and `librosa` of the
//! compound features whose originals changed in more than that. It fills in what a configuration
//! leaves open and is gone after that: outputs store the values themselves, so that a configuration
//! with the switch and one that spells them out have the same hash, and a new feature takes part by
//! having such a key.

use corsmal_dsp::librosa::LibrosaVersion;
use serde_json::{Value, json};

use super::ConfigError;
use crate::features;

/// Resolves the key in a configuration tree.
pub fn resolve(tree: &mut Value) -> Result<(), ConfigError> {
    let Some(object) = tree.as_object_mut() else { return Ok(()) };
    let Some(value) = object.remove("librosa") else { return Ok(()) };
    // TOML and --set may give a number.
    let name = value.as_str().map_or_else(|| value.to_string(), str::to_string);
    let version: LibrosaVersion = serde_json::from_value(Value::String(name)).map_err(|_| {
        ConfigError::key("librosa", format!("= {value}: expected \"0.8\" or \"0.11\""))
    })?;
    if let Some(signal) = object.entry("signal").or_insert_with(|| json!({})).as_object_mut() {
        signal.entry("res_type").or_insert(json!(version.res_type()));
    }
    let Some(configured) = object.get_mut("features").and_then(Value::as_object_mut) else {
        return Ok(());
    };
    for (name, feature) in configured {
        let Some(table) = feature.as_object_mut() else { continue };
        let kind = table.get("kind").and_then(Value::as_str).unwrap_or(name);
        let Some(entry) = features::registry().iter().find(|e| e.kind() == kind) else { continue };
        let known = entry.defaults();
        for (key, value) in [("pad_mode", json!(version.pad_mode())), ("librosa", json!(version))] {
            if known.get(key).is_some() {
                table.entry(key).or_insert(value);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::config::Config;

    fn config(text: &str, overrides: &[&str]) -> Result<Config, String> {
        let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
        Config::with_overrides(text, "test", &overrides).map_err(|e| e.to_string())
    }

    #[test]
    fn the_switch_is_what_it_spells_out() {
        let plain = "[features.mfcc]\n[features.rms]\n[features.af193]";
        let spelled = "[signal]\nres_type = 'kaiser_best'\n[features.mfcc]\npad_mode = 'reflect'\n\
            [features.rms]\npad_mode = 'reflect'\n[features.af193]\nlibrosa = '0.8'";
        let switched = config(plain, &["librosa=0.8"]).unwrap();
        assert_eq!(switched.to_value(), config(spelled, &[]).unwrap().to_value());
        let text = format!("librosa = '0.8'\n{plain}");
        assert_eq!(switched.hash(), config(&text, &[]).unwrap().hash());
        let modern = config(plain, &["librosa=0.11"]).unwrap();
        assert_eq!(modern.hash(), config(plain, &[]).unwrap().hash());
        assert_ne!(modern.hash(), switched.hash());
    }

    #[test]
    fn what_a_configuration_says_itself_stays() {
        let text = "librosa = '0.8'\n[features.m]\nkind = 'mfcc'\npad_mode = 'edge'";
        assert_eq!(config(text, &[]).unwrap().to_value()["features"]["m"]["pad_mode"], "edge");
    }

    #[test]
    fn other_versions_are_refused() {
        let refused = config("[features.mfcc]", &["librosa=0.9"]).unwrap_err();
        assert_eq!(refused, "configuration key librosa: = 0.9: expected \"0.8\" or \"0.11\"");
    }
}
