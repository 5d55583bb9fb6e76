//! Why a configuration was refused.

use thiserror::Error;

/// Why a configuration was refused: names the key, the value, and what is allowed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("configuration {path}: {source}")]
    Read {
        /// Path of the file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// The text is not TOML.
    #[error("configuration {place}: {message}")]
    Syntax {
        /// Path or option.
        place: String,
        /// What the parser says.
        message: String,
    },
    /// A key is unknown or its value impossible.
    #[error("configuration key {key}: {message}")]
    Key {
        /// Dotted path of the key.
        key: String,
        /// The value and what is allowed.
        message: String,
    },
    /// No preset has this name.
    #[error("preset \"{name}\" is unknown: {choices}")]
    Preset {
        /// The name that was given.
        name: String,
        /// The one that was probably meant, and the known ones.
        choices: String,
    },
}

impl ConfigError {
    /// A refusal of `key`.
    pub fn key(key: impl Into<String>, message: impl std::fmt::Display) -> Self {
        Self::Key { key: key.into(), message: message.to_string() }
    }
}
