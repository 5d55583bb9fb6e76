//! A recording of a run.

use std::fmt;
use std::path::PathBuf;

/// Where the bytes of a recording come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InputSource {
    /// A file.
    File(PathBuf),
    /// Standard input.
    Stdin,
}

impl fmt::Display for InputSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Stdin => f.write_str("-"),
        }
    }
}

/// One recording, or a stretch of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Unique in the run.
    pub id: String,
    /// Where its bytes come from.
    pub source: InputSource,
    /// Start of the stretch in seconds.
    pub start: Option<f64>,
    /// End of the stretch in seconds.
    pub end: Option<f64>,
    /// Label columns as (name, value); every input of a run has the same names in the same order.
    pub labels: Vec<(String, String)>,
}

/// BLAKE3 (hex) over ids, paths, stretches and labels of all inputs: equal for equal lists only.
pub fn list_hash(inputs: &[Input]) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut put = |text: &str| {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    };
    for input in inputs {
        put(&input.id);
        put(&input.source.to_string());
        for time in [input.start, input.end] {
            put(&time.map(|t| t.to_string()).unwrap_or_default());
        }
        put(&input.labels.len().to_string());
        for (column, value) in &input.labels {
            put(column);
            put(value);
        }
    }
    hasher.finalize().to_hex().to_string()
}
