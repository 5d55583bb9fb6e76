//! `--set key=value`.

use serde_json::{Map, Value};

use crate::params::ConfigError;

/// Applies one assignment to a configuration tree. A key that starts with none of the other tables
/// is a feature's (`mfcc.n_mels` is `features.mfcc.n_mels`); the value is TOML, or else a plain
/// string.
pub fn apply(tree: &mut Value, assignment: &str) -> Result<(), ConfigError> {
    let Some((key, text)) = assignment.split_once('=') else {
        let message = "expected key=value, such as mfcc.n_mels=64";
        return Err(ConfigError::Syntax {
            place: format!("--set {assignment}"),
            message: message.into(),
        });
    };
    let (key, text) = (key.trim(), text.trim());
    let mut parts: Vec<&str> = key.split('.').collect();
    if parts.iter().any(|p| p.is_empty()) || (parts.len() < 2 && key != "librosa") {
        let message = "expected a dotted key, such as signal.sample_rate or mfcc.n_mels";
        return Err(ConfigError::key(key, message));
    }
    if !matches!(parts[0], "signal" | "features" | "summary" | "projection" | "librosa") {
        parts.insert(0, "features");
    }
    let value = toml::from_str::<toml::Table>(&format!("value = {text}"))
        .ok()
        .and_then(|mut table| table.remove("value"))
        .map_or_else(|| Value::String(text.to_string()), to_json);
    let mut place = tree;
    let (last, path) = parts.split_last().expect("one part at least");
    for part in path {
        let object = place
            .as_object_mut()
            .ok_or_else(|| ConfigError::key(key, format!("{part} is not in a table")))?;
        place = object.entry(*part).or_insert_with(|| Value::Object(Map::new()));
    }
    match place.as_object_mut() {
        Some(object) => object.insert((*last).to_string(), value),
        None => return Err(ConfigError::key(key, "is not in a table")),
    };
    Ok(())
}

/// The same tree as JSON. JSON has no number for infinity and NaN: they are the words `inf`, `-inf`
/// and `NaN`, which keys that allow them take and others refuse by name.
pub fn to_json(value: toml::Value) -> Value {
    match value {
        toml::Value::Table(table) => {
            Value::Object(table.into_iter().map(|(key, value)| (key, to_json(value))).collect())
        }
        toml::Value::Array(values) => values.into_iter().map(to_json).collect(),
        toml::Value::Float(number) => serde_json::Number::from_f64(number)
            .map_or_else(|| Value::String(number.to_string()), Value::Number),
        toml::Value::Integer(number) => number.into(),
        toml::Value::Boolean(flag) => flag.into(),
        toml::Value::String(text) => text.into(),
        toml::Value::Datetime(time) => time.to_string().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn infinity_is_a_word() {
        let mut tree = json!({});
        apply(&mut tree, "melspectrogram.norm=inf").unwrap();
        assert_eq!(tree["features"]["melspectrogram"]["norm"], "inf");
        apply(&mut tree, "signal.start=-nan").unwrap();
        assert_eq!(tree["signal"]["start"].as_str().unwrap().to_lowercase(), "nan");
    }

    #[test]
    fn values_are_toml_and_features_are_the_default_table() {
        let mut tree = json!({"features": {"mfcc": {}}});
        for assignment in
            ["mfcc.n_mels=64", "signal.channels=mean", "summary.stats=[\"mean\", \"std\"]"]
        {
            apply(&mut tree, assignment).unwrap();
        }
        assert_eq!(tree["features"]["mfcc"]["n_mels"], 64);
        assert_eq!(tree["signal"]["channels"], "mean");
        assert_eq!(tree["summary"]["stats"][1], "std");
        assert!(apply(&mut tree, "n_mels").is_err());
        assert!(apply(&mut tree, "n_mels=3").is_err());
    }
}
