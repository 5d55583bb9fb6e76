//! Label names and class indices.

use std::collections::{BTreeSet, HashMap};

use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};

/// Most classes that are learned and scored.
pub const MAX_CLASSES: usize = 4096;

/// Refuses more than [`MAX_CLASSES`].
pub(crate) fn require_few(classes: usize) -> Result<()> {
    if classes > MAX_CLASSES { Err(ModelError::TooManyClasses { classes }) } else { Ok(()) }
}

/// The names of the classes; a class index is a position in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Labels(Vec<String>);

impl Labels {
    /// A table in the order given.
    ///
    /// # Errors
    /// A name that occurs twice.
    pub fn new(names: Vec<String>) -> Result<Self> {
        let different: BTreeSet<_> = names.iter().collect();
        if different.len() != names.len() {
            return Err(ModelError::Inconsistent("a label name occurs twice".into()));
        }
        Ok(Self(names))
    }

    /// The names that occur, whole numbers by value, anything else by text, with each row's class.
    pub fn of<S: AsRef<str>>(rows: &[S]) -> (Self, Vec<usize>) {
        let different: BTreeSet<&str> = rows.iter().map(AsRef::as_ref).collect();
        let mut names: Vec<&str> = different.into_iter().collect();
        if names.iter().all(|n| n.parse::<i64>().is_ok()) {
            names.sort_by_key(|n| n.parse::<i64>().unwrap_or(0));
        }
        let table = Self(names.into_iter().map(String::from).collect());
        let position = positions(&table.0);
        let classes = rows.iter().map(|r| position[r.as_ref()]).collect();
        (table, classes)
    }

    /// Class index of each name.
    ///
    /// # Errors
    /// [`ModelError::UnknownName`] for a name that is not in the table.
    pub fn encode<S: AsRef<str>>(&self, rows: &[S]) -> Result<Vec<usize>> {
        let position = positions(&self.0);
        rows.iter()
            .map(|row| {
                let row = row.as_ref();
                position.get(row).copied().ok_or_else(|| ModelError::UnknownName {
                    kind: "label",
                    name: row.into(),
                    allowed: corsmal_names::choices(row, self.0.iter().map(String::as_str)),
                })
            })
            .collect()
    }

    /// The names.
    pub fn names(&self) -> &[String] {
        &self.0
    }

    /// Number of classes.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is no class.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// The index of each name.
pub(crate) fn positions(names: &[String]) -> HashMap<&str, usize> {
    names.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect()
}
