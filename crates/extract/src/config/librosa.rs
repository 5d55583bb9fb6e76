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
        let of = |v: LibrosaVersion| json!(v.res_type());
        fill(signal, "signal.res_type", version, of)?;
    }
    let Some(configured) = object.get_mut("features").and_then(Value::as_object_mut) else {
        return Ok(());
    };
    for (name, feature) in configured {
        let Some(table) = feature.as_object_mut() else { continue };
        let kind = table.get("kind").and_then(Value::as_str).unwrap_or(name);
        let Some(entry) = features::registry().iter().find(|e| e.kind() == kind) else { continue };
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
            "= {own} is librosa {other}'s and librosa = {version} leaves it so: leave one of them out"
        );
        return Err(ConfigError::key(key, message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::config::{Config, Preset};

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
    fn what_is_spelled_out_as_the_other_versions_is_refused() {
        let preset = Preset::find("spec9216-code").unwrap();
        let refused = config(preset.toml, &["librosa=0.11"]).unwrap_err();
        let expected = "configuration key signal.res_type: = \"kaiser_best\" is librosa \"0.8\"'s";
        assert!(refused.starts_with(expected), "{refused}");
        let own = "librosa = '0.8'\n[features.rms]\npad_mode = 'constant'";
        let refused = config(own, &[]).unwrap_err();
        assert!(refused.contains("features.rms.pad_mode"), "{refused}");
        let own = "librosa = '0.8'\n[features.af193]\nlibrosa = '0.11'";
        assert!(config(own, &[]).unwrap_err().contains("features.af193.librosa"));
    }

    #[test]
    fn other_versions_are_refused() {
        let refused = config("[features.mfcc]", &["librosa=0.9"]).unwrap_err();
        assert_eq!(refused, "configuration key librosa: = 0.9: expected \"0.8\" or \"0.11\"");
    }
}
