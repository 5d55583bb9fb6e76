//! Changes to a configuration: `--set key=value` and `--add feature`.

use std::collections::HashMap;

use serde_json::{Map, Value, json};

use super::signal::SignalConfig;
use crate::features;
use crate::params::{ConfigError, elsewhere};
use crate::summary::SummaryConfig;

/// Tables beside `features`.
const TABLES: [&str; 3] = ["signal", "summary", "projection"];

/// Refuses a key that several changes set: the last one would win.
pub fn check_once_each(changes: &[String]) -> Result<(), ConfigError> {
    let mut seen: HashMap<String, &str> = HashMap::new();
    for change in changes.iter().filter(|change| !change.starts_with('+')) {
        let Some((key, text)) = change.split_once('=') else { continue };
        let (key, text) = (key.trim(), text.trim());
        let short = key.strip_prefix("features.").unwrap_or(key);
        if let Some(first) = seen.insert(short.into(), text) {
            let message = format!("is given twice, as {first} and as {text}: keep one of them");
            return Err(ConfigError::key(key, message));
        }
    }
    Ok(())
}

/// Applies one change to a configuration tree: `key=value`, or `+NAME` or `+NAME=KIND`, which adds a
/// feature with its defaults.
///
/// A key that starts with none of the other tables is a feature's (`mfcc.n_mels` is
/// `features.mfcc.n_mels`), and the feature must be there; the value is TOML, or else a plain
/// string.
pub fn apply(tree: &mut Value, change: &str) -> Result<(), ConfigError> {
    if let Some(feature) = change.strip_prefix('+') {
        return add(tree, feature.trim());
    }
    let Some((key, text)) = change.split_once('=') else {
        let message = "expected key=value, such as signal.sample_rate=16000";
        return Err(ConfigError::Syntax {
            place: format!("--set {change}"),
            message: message.into(),
        });
    };
    let (key, text) = (key.trim(), text.trim());
    let mut parts: Vec<&str> = key.split('.').collect();
    if parts.iter().any(|part| part.is_empty()) {
        return Err(ConfigError::key(key, "expected a dotted key, such as signal.sample_rate"));
    }
    if parts.len() == 1 && key != "librosa" {
        let found = homes(tree, key);
        let message = match found.is_empty() {
            true => "expected a dotted key, such as signal.sample_rate or mfcc.n_mels".to_string(),
            false => {
                format!("expected a dotted key: did you mean {}?", assigned(key, &found, text))
            }
        };
        return Err(ConfigError::key(key, message));
    }
    if !TABLES.contains(&parts[0]) && parts[0] != "features" && key != "librosa" {
        parts.insert(0, "features");
    }
    let value = toml::from_str::<toml::Table>(&format!("value = {text}"))
        .ok()
        .and_then(|mut table| table.remove("value"))
        .map_or_else(|| plain(text), to_json);
    if let ["features", name, last, ..] = parts[..]
        && feature_kind(tree, name).is_none()
    {
        return Err(ConfigError::key(key, absent(tree, name, last, text)));
    }
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

/// A value that is not TOML: a number such as `.5`, or a plain string.
fn plain(text: &str) -> Value {
    let is_digit = |c: char| c.is_ascii_digit();
    match text.parse::<f64>() {
        Ok(number)
            if number.is_finite() && text.starts_with(|c| c == '.' || c == '-' || is_digit(c)) =>
        {
            json!(number)
        }
        _ => Value::String(text.to_string()),
    }
}

/// Adds the feature `NAME` or `NAME=KIND`.
fn add(tree: &mut Value, feature: &str) -> Result<(), ConfigError> {
    let (name, kind) = match feature.split_once('=') {
        Some((name, kind)) => (name.trim(), kind.trim()),
        None => (feature, feature),
    };
    if features::find(kind).is_none() {
        let choices = corsmal_names::choices(kind, features::kinds());
        return Err(ConfigError::key(
            format!("--add {feature}"),
            format!("there is no such feature: {choices}"),
        ));
    }
    if feature_kind(tree, name).is_some() {
        let message = format!(
            "the configuration already has {name}: --set {name}.KEY=VALUE changes it, \
             --add NEW_NAME={kind} adds another one"
        );
        return Err(ConfigError::key(format!("--add {feature}"), message));
    }
    let root = tree.as_object_mut();
    let table = root.map(|root| root.entry("features").or_insert_with(|| json!({})));
    match table.and_then(Value::as_object_mut) {
        Some(table) => table.insert(name.into(), json!({"kind": kind})),
        None => return Err(ConfigError::key("features", "is not a table")),
    };
    Ok(())
}

/// Features of the tree: name, kind.
fn configured(tree: &Value) -> impl Iterator<Item = (&str, &str)> {
    let table = tree.get("features").and_then(Value::as_object);
    table.into_iter().flatten().map(|(name, feature)| {
        (name.as_str(), feature.get("kind").and_then(Value::as_str).unwrap_or(name))
    })
}

fn feature_kind<'t>(tree: &'t Value, name: &str) -> Option<&'t str> {
    configured(tree).find(|(configured, _)| *configured == name).map(|(_, kind)| kind)
}

/// Dotted keys of the tree that end with this one, or else with the one most like it.
fn homes(tree: &Value, key: &str) -> Vec<String> {
    if let Some(home) = elsewhere(key) {
        return vec![home.to_string()];
    }
    let mut all: Vec<(String, String)> = Vec::new();
    let mut table = |prefix: &str, keys: Value| {
        let keys = keys.as_object().into_iter().flatten();
        all.extend(keys.map(|(last, _)| (format!("{prefix}.{last}"), last.clone())));
    };
    table("signal", json!(SignalConfig::default()));
    table("summary", json!(SummaryConfig::default()));
    for (name, kind) in configured(tree) {
        table(name, features::find(kind).map_or(Value::Null, |entry| entry.defaults()));
    }
    let wanted = match all.iter().any(|(_, last)| last == key) {
        true => Some(key.to_string()),
        false => {
            let known = all.iter().map(|(_, last)| last.as_str());
            corsmal_names::closest(key, known).map(str::to_string)
        }
    };
    let home =
        |(dotted, last): (String, String)| (Some(&last) == wanted.as_ref()).then_some(dotted);
    all.into_iter().filter_map(home).collect()
}

/// The assignments to these keys that may have been meant by one to `key`.
fn assigned(key: &str, keys: &[String], text: &str) -> String {
    // librosa's mono is a truth value.
    let text = match (key, text) {
        ("mono", "true" | "True") => "mean",
        ("mono", _) => "all",
        _ => text,
    };
    let assignments: Vec<String> = keys.iter().map(|key| format!("{key}={text}")).collect();
    assignments.join(" or ")
}

/// Why a key of a feature that is not there is refused, and what to do.
fn absent(tree: &Value, name: &str, last: &str, text: &str) -> String {
    let there: Vec<&str> = configured(tree).map(|(name, _)| name).collect();
    let mut message = match there.is_empty() {
        true => format!("the configuration has no feature {name}"),
        false => format!("the configuration has no feature {name} (it has {})", there.join(", ")),
    };
    let slips = there.iter().copied().chain(TABLES);
    let meant = corsmal_names::closest(name, slips).filter(|_| features::find(name).is_none());
    let found = match meant {
        Some(meant) => vec![format!("{meant}.{last}")],
        None => homes(tree, last),
    };
    let adds = features::find(name).is_some();
    match (found.is_empty(), adds) {
        (false, _) => message += &format!(": did you mean {}?", assigned(last, &found, text)),
        (true, true) => message.push(';'),
        (true, false) => {}
    }
    if adds {
        message += &format!(" --add {name} adds the feature");
    }
    message
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

    #[test]
    fn infinity_is_a_word() {
        let mut tree = json!({"features": {"melspectrogram": {}}});
        apply(&mut tree, "melspectrogram.norm=inf").unwrap();
        assert_eq!(tree["features"]["melspectrogram"]["norm"], "inf");
        apply(&mut tree, "signal.start=-nan").unwrap();
        assert_eq!(tree["signal"]["start"].as_str().unwrap().to_lowercase(), "nan");
    }

    #[test]
    fn a_key_is_set_once() {
        let check = |changes: &[&str]| {
            let changes: Vec<String> = changes.iter().map(ToString::to_string).collect();
            check_once_each(&changes).map_err(|e| e.to_string())
        };
        for second in ["mfcc.n_mels=40", "features.mfcc.n_mels = 40"] {
            let refused = check(&["mfcc.n_mels=64", "signal.channels=mean", second]).unwrap_err();
            assert!(
                refused.ends_with("is given twice, as 64 and as 40: keep one of them"),
                "{refused}"
            );
        }
        assert!(check(&["+a=mfcc", "+b=mfcc", "a.n_mels=64", "b.n_mels=40"]).is_ok());
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

    #[test]
    fn keys_without_a_home_say_where_they_may_belong() {
        let refused = |change: &str| {
            let mut tree = json!({"features": {"log": {"kind": "melspectrogram"}, "rms": {}}});
            let before = tree.clone();
            let refusal = apply(&mut tree, change).unwrap_err().to_string();
            assert_eq!(tree, before, "{change}");
            refusal
        };
        for (change, says) in [
            ("sr=16000", "did you mean signal.sample_rate=16000?"),
            ("sample_rate=16000", "did you mean signal.sample_rate=16000?"),
            ("samplerate=16000", "did you mean signal.sample_rate=16000?"),
            ("mono=true", "did you mean signal.channels=mean?"),
            ("n_mels=64", "did you mean log.n_mels=64?"),
            ("n_mel=64", "did you mean log.n_mels=64?"),
            ("hop_length=64", "did you mean log.hop_length=64 or rms.hop_length=64?"),
            ("stats=mean", "did you mean summary.stats=mean?"),
            ("x=1", "expected a dotted key, such as signal.sample_rate or mfcc.n_mels"),
            (
                "mfcc.n_mels=64",
                "no feature mfcc (it has log, rms): did you mean log.n_mels=64? --add mfcc adds the feature",
            ),
            ("features.mfcc.n_mels=64", "--add mfcc adds the feature"),
            ("logg.n_mels=64", "did you mean log.n_mels=64?"),
            ("singal.sample_rate=1", "did you mean signal.sample_rate=1?"),
            ("logmel.n_mels=64", "did you mean log.n_mels=64?"),
            ("mfcc.n_mfcc=13", "no feature mfcc (it has log, rms); --add mfcc adds the feature"),
        ] {
            let refusal = refused(change);
            assert!(refusal.ends_with(says), "{change}: {refusal}");
        }
    }

    #[test]
    fn numbers_may_begin_with_a_point() {
        let mut tree = json!({"features": {"mfcc": {}}});
        for (text, value) in [(".5", json!(0.5)), ("-.5", json!(-0.5)), ("1e-3", json!(1e-3))] {
            apply(&mut tree, &format!("mfcc.fmin={text}")).unwrap();
            assert_eq!(tree["features"]["mfcc"]["fmin"], value);
        }
        for word in ["inf", "nan", "-", ".", "infinity", "1 2"] {
            apply(&mut tree, &format!("mfcc.x={word}")).unwrap();
            assert!(!tree["features"]["mfcc"]["x"].is_number(), "{word}");
        }
    }

    #[test]
    fn features_are_added_by_name_and_kind() {
        let mut tree = json!({"features": {"rms": {}}});
        apply(&mut tree, "+mfcc").unwrap();
        apply(&mut tree, "mfcc.n_mels=64").unwrap();
        apply(&mut tree, "+quiet=rms").unwrap();
        assert_eq!(tree["features"]["mfcc"], json!({"kind": "mfcc", "n_mels": 64}));
        assert_eq!(tree["features"]["quiet"]["kind"], "rms");
        let refusal = apply(&mut tree, "+rms").unwrap_err().to_string();
        assert!(refusal.contains("already has rms"), "{refusal}");
        let refusal = apply(&mut tree, "+mfc").unwrap_err().to_string();
        assert!(refusal.contains("did you mean \"mfcc\"?"), "{refusal}");
        let mut empty = json!({});
        apply(&mut empty, "+rms").unwrap();
        assert_eq!(empty["features"]["rms"]["kind"], "rms");
    }
}
