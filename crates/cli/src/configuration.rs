//! Configurations in words: the preset that one is nearest to, and where two differ.

use corsmal_extract::config::{Config, PRESETS};
use serde_json::Value;

/// Keys that a message names.
const NAMED: usize = 4;

/// How features made with `found` differ from those made with `wanted`, and how to make these.
pub fn difference(wanted: &Value, found: &Value) -> String {
    let ((wanted_base, changes), (found_base, _)) = (nearest(wanted), nearest(found));
    if wanted_base != found_base {
        let anew = match (wanted_base.strip_prefix("preset "), changes.len()) {
            (Some(preset), 0) => format!(": extract with --preset {preset}"),
            _ => String::new(),
        };
        return format!("{wanted_base} is expected, found {found_base}{anew}");
    }
    let mut keys = Vec::new();
    compare("", found, wanted, &mut keys);
    let more = match keys.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    keys.truncate(NAMED);
    format!(
        "{found_base} with other values (those expected in brackets): {}{more}",
        keys.join(", ")
    )
}

/// The preset with the fewest other values among those of the same features, or a configuration of
/// these features with every default; then every key that differs from it, `key = value (there)`.
pub fn nearest(config: &Value) -> (String, Vec<String>) {
    let mut bases: Vec<(String, Value)> = Vec::new();
    for preset in PRESETS {
        if let Ok(preset_config) = Config::preset(preset.name) {
            bases.push((format!("preset {}", preset.name), preset_config.to_value()));
        }
    }
    let kinds = config["features"].as_object().into_iter().flatten();
    let defaults = kinds.map(|(name, feature)| {
        let kind = feature.get("kind").and_then(Value::as_str).unwrap_or(name);
        (name.clone(), serde_json::json!({"kind": kind}))
    });
    let defaults = serde_json::json!({"features": defaults.collect::<serde_json::Map<_, _>>()});
    if let Ok(defaults) = Config::from_value(defaults) {
        bases.push(("every key at its default".into(), defaults.to_value()));
    }
    let found = bases.into_iter().filter(|(_, base)| names(base) == names(config));
    let compared = found.map(|(name, base)| {
        let mut lines = Vec::new();
        compare("", config, &base, &mut lines);
        (name, lines)
    });
    compared.min_by_key(|(_, lines)| lines.len()).unwrap_or_else(|| {
        let mut lines = Vec::new();
        compare("", config, &Value::Null, &mut lines);
        ("no key that this version knows".into(), lines)
    })
}

/// Names of the features.
fn names(config: &Value) -> Vec<&String> {
    config["features"].as_object().into_iter().flatten().map(|(name, _)| name).collect()
}

/// Adds a line for every key whose value is another one than in `base`: `key = value  (there)`.
pub fn compare(key: &str, value: &Value, base: &Value, lines: &mut Vec<String>) {
    let Value::Object(table) = value else {
        if value != base {
            let there = match base {
                Value::Null => String::new(),
                there => format!("  ({there})"),
            };
            lines.push(format!("{key} = {value}{there}"));
        }
        return;
    };
    for (name, value) in table {
        let key = match key {
            "" | "features" => name.clone(),
            key => format!("{key}.{name}"),
        };
        compare(&key, value, base.get(name).unwrap_or(&Value::Null), lines);
    }
    for (name, there) in base.as_object().into_iter().flatten() {
        if !table.contains_key(name) {
            lines.push(format!("{key}.{name} is missing  ({there})"));
        }
    }
}
