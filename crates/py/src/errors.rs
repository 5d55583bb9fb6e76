//! The exceptions of `corsmal_feat.errors`, and our refusals as such.

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

/// Any of our refusals as `ParameterError` (a `ValueError`).
pub(crate) fn value_error(error: impl std::fmt::Display) -> PyErr {
    ParameterError::new_err(in_python(&error.to_string()))
}

/// Options of the command that are arguments in Python, and whether they take no value.
const OPTIONS: [(&str, bool); 13] = [
    ("any-rate", true),
    ("cv", false),
    ("device", false),
    ("groups", false),
    ("id-column", false),
    ("labels", false),
    ("numeric", true),
    ("overwrite", true),
    ("resume", true),
    ("set", false),
    ("standardize", true),
    ("target", false),
    ("tune", false),
];

/// A message of ours with the options of the command as Python's arguments.
#[pyfunction]
pub(crate) fn in_python(message: &str) -> String {
    let mut words = message.split(' ');
    let mut text = String::with_capacity(message.len());
    while let Some(word) = words.next() {
        if !text.is_empty() {
            text.push(' ');
        }
        let (before, option) = word.split_once("--").unwrap_or((word, ""));
        let length = option.find(|c: char| c != '-' && !c.is_ascii_lowercase());
        let (name, after) = option.split_at(length.unwrap_or(option.len()));
        let known = OPTIONS.iter().find(|(known, _)| *known == name);
        match known.filter(|_| before.chars().all(|c| c.is_ascii_punctuation())) {
            None => text.push_str(word),
            Some(("set", _)) => {
                let change = words.next().unwrap_or_default();
                match change.split_once('=') {
                    None => text.extend([before, "set ", change]),
                    Some((key, value)) => {
                        let quote = if value.parse::<f64>().is_ok() { "" } else { "\"" };
                        let value = match value {
                            "true" => "True".into(),
                            "false" => "False".into(),
                            value => format!("{quote}{value}{quote}"),
                        };
                        text.push_str(&format!("{before}set={{\"{key}\": {value}}}"));
                    }
                }
            }
            Some((name, is_flag)) => {
                let end = if *is_flag { "=True" } else { "" };
                text.extend([before, &name.replace('-', "_"), end, after]);
            }
        }
    }
    text
}
