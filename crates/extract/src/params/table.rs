//! Tables of plain values as typed parameters.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::error::ConfigError;
use super::keys::elsewhere;

/// A table of plain values as its typed struct. Unknown keys are refused by comparison with the
/// keys of the default value, since serde cannot do so across flattened groups.
///
/// # Errors
/// An unknown key, or the first value that is impossible.
pub fn typed<T>(prefix: &str, table: &Map<String, Value>) -> Result<T, ConfigError>
where
    T: for<'de> Deserialize<'de> + Serialize + Default,
{
    let known: Vec<String> = match serde_json::to_value(T::default()) {
        Ok(Value::Object(map)) => map.keys().cloned().collect(),
        _ => Vec::new(),
    };
    if let Some(key) = table.keys().find(|k| !known.contains(k)) {
        let message = match elsewhere(key) {
            Some(here) => format!("is unknown here: did you mean {here}?"),
            None => {
                let choices = corsmal_names::choices(key, known.iter().map(String::as_str));
                format!("is unknown here: {choices}")
            }
        };
        return Err(ConfigError::key(format!("{prefix}.{key}"), message));
    }
    let parse = |table: Map<String, Value>| serde_json::from_value::<T>(Value::Object(table));
    parse(table.clone()).map_err(|error| {
        // Serde does not name the key of a wrong value: find it by trying keys one at a time.
        let wrong = table.iter().find_map(|(key, value)| {
            let one = Map::from_iter([(key.clone(), value.clone())]);
            parse(one).err().map(|e| (key, value, e))
        });
        match wrong {
            Some((key, value, e)) => {
                let message = refusal(value, &e.to_string());
                ConfigError::key(format!("{prefix}.{key}"), message)
            }
            None => ConfigError::key(prefix, error),
        }
    })
}

/// Serde's message about a value as one for users: what it must be, and the word that was meant.
fn refusal(value: &Value, message: &str) -> String {
    let message = message.split(" at line ").next().unwrap_or(message);
    if message.starts_with("unknown variant") {
        let quoted: Vec<&str> = message.split('`').skip(3).step_by(2).collect();
        let given = value.as_str().unwrap_or_default();
        return format!("{value} is unknown: {}", corsmal_names::choices(given, quoted));
    }
    let expected = message.strip_prefix("expected ");
    let Some(expected) = expected.or_else(|| message.split_once(", expected ").map(|(_, e)| e))
    else {
        return message.into();
    };
    let plain = match expected {
        "usize" | "u8" | "u32" | "u64" => "a whole number of at least 0",
        "f64" | "f32" => "a number",
        "a boolean" => "true or false",
        "a sequence" => "a list such as [1, 2]",
        other => other,
    };
    format!("must be {plain}, not {value}")
}
