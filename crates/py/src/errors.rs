//! The exceptions of `corsmal_feat.errors`, and our refusals as such.

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

pyo3::import_exception!(corsmal_feat.errors, ConfigError);
pyo3::import_exception!(corsmal_feat.errors, DecodeError);
pyo3::import_exception!(corsmal_feat.errors, ModelError);
pyo3::import_exception!(corsmal_feat.errors, MissingFileError);
pyo3::import_exception!(corsmal_feat.errors, ParameterError);
pyo3::import_exception!(corsmal_feat.errors, RunError);

/// A refused model file.
pub(crate) fn model_error(error: impl std::fmt::Display) -> PyErr {
    ModelError::new_err(in_python(&error.to_string()))
}

/// A refused configuration.
pub(crate) fn config_error(error: impl std::fmt::Display) -> PyErr {
    ConfigError::new_err(in_python(&error.to_string()))
}

/// A run that could not go on.
pub(crate) fn run_error(error: &dyn std::fmt::Display) -> PyErr {
    RunError::new_err(in_python(&error.to_string()))
}

/// A run that the user stopped.
pub(crate) fn interrupted(error: &dyn std::fmt::Display) -> PyErr {
    PyKeyboardInterrupt::new_err(in_python(&error.to_string()))
}

/// Any of our refusals as `ParameterError` (a `ValueError`).
pub(crate) fn value_error(error: impl std::fmt::Display) -> PyErr {
    ParameterError::new_err(in_python(&error.to_string()))
}

/// Options of the command that are arguments in Python, and whether they take no value.
const OPTIONS: [(&str, bool); 16] = [
    ("any-rate", true),
    ("containers", false),
    ("cv", false),
    ("device", false),
    ("groups", false),
    ("id-column", false),
    ("jobs", false),
    ("labels", false),
    ("numeric", true),
    ("out", false),
    ("overwrite", true),
    ("preset", false),
    ("resume", true),
    ("standardize", true),
    ("target", false),
    ("tune", false),
];

/// A message of ours with the options of the command as Python's arguments.
#[pyfunction]
pub(crate) fn in_python(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    let mut left = message;
    while let Some(at) = left.find("--") {
        let (before, rest) = left.split_at(at);
        text.push_str(before);
        // Paths and words may hold what looks like an option.
        let stands_alone =
            text.chars().next_back().is_none_or(|c| c.is_whitespace() || "(\"'`".contains(c));
        let name = &rest[2..];
        let end = name.find(|c: char| c != '-' && !c.is_ascii_lowercase()).unwrap_or(name.len());
        let (name, after) = name.split_at(end);
        let ends = !after.starts_with(['/', '.', '_', '=', '\\'])
            || after.starts_with(". ")
            || after == ".";
        let known = OPTIONS.iter().find(|(known, _)| *known == name);
        left = match (known, set(name, after)) {
            (_, Some((change, after))) if stands_alone => {
                text.push_str(&change);
                after
            }
            (Some((name, is_flag)), _) if stands_alone && ends => {
                text.push_str(&name.replace('-', "_"));
                text.push_str(if *is_flag { "=True" } else { "" });
                after
            }
            _ => {
                text.push_str(&rest[..2 + end]);
                after
            }
        };
    }
    text + left
}

/// `--set KEY=VALUE` as the argument `set`, and what follows.
fn set<'a>(name: &str, after: &'a str) -> Option<(String, &'a str)> {
    let change = after.strip_prefix(' ').filter(|_| name == "set")?;
    let word = change.split(char::is_whitespace).next()?;
    let word = word.trim_end_matches([',', ';', ':', ')', '"', '\'', '`', '.']);
    let (key, value) = word.split_once('=')?;
    // Lists may hold blanks: they stay as they are.
    let is_plain = |text: &str| text.chars().all(|c| c.is_alphanumeric() || "_.-+".contains(c));
    if key.is_empty() || value.is_empty() || !is_plain(key) || !is_plain(value) {
        return None;
    }
    let value = match value {
        "true" => "True".into(),
        "false" => "False".into(),
        value if value.parse::<f64>().is_ok_and(f64::is_finite) => value.to_owned(),
        value => format!("\"{value}\""),
    };
    Some((format!("set={{\"{key}\": {value}}}"), &change[word.len()..]))
}
