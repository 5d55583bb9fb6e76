//! An input that was found and not yet named.

use std::path::PathBuf;

use super::input::InputSource;

/// An input before it has its final id.
pub(super) struct Found {
    pub(super) source: InputSource,
    pub(super) naming: Naming,
    pub(super) start: Option<f64>,
    pub(super) end: Option<f64>,
    pub(super) labels: Vec<(String, String)>,
    /// Of the manifest that lists it.
    pub(super) line: Option<u64>,
}

/// What the id is made of.
pub(super) enum Naming {
    Given(String),
    /// Path relative to the root.
    Derived(PathBuf),
}

impl Found {
    /// A recording at `path`, which is `relative` to its root.
    pub(super) fn file(path: PathBuf, relative: PathBuf) -> Self {
        Self {
            source: InputSource::at(path),
            naming: Naming::Derived(relative),
            start: None,
            end: None,
            labels: Vec::new(),
            line: None,
        }
    }

    /// The input as messages name it.
    pub(super) fn described(&self) -> String {
        match self.line {
            Some(line) => format!("{} (line {line})", self.source),
            None => self.source.to_string(),
        }
    }
}
