//! Label names and class indices.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};

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
        let position: std::collections::HashMap<&str, usize> =
            table.0.iter().enumerate().map(|(i, n)| (n.as_str(), i)).collect();
        let classes = rows.iter().map(|r| position[r.as_ref()]).collect();
        (table, classes)
    }

    /// Class index of each name.
    ///
    /// # Errors
    /// [`ModelError::UnknownName`] for a name that is not in the table.
    pub fn encode<S: AsRef<str>>(&self, rows: &[S]) -> Result<Vec<usize>> {
        rows.iter()
            .map(|row| {
                let row = row.as_ref();
                self.0.iter().position(|n| n == row).ok_or_else(|| ModelError::UnknownName {
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
