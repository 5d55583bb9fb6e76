//! Label names and class indices.

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};

use serde::{Deserialize, Serialize};
use unicode_normalization::UnicodeNormalization;

use crate::error::{ModelError, Result};

/// Most classes that are learned and scored.
pub const MAX_CLASSES: usize = 4096;

/// Refuses more than [`MAX_CLASSES`].
pub(crate) fn require_few(classes: usize) -> Result<()> {
    if classes > MAX_CLASSES {
        return Err(ModelError::TooManyClasses { classes, most: MAX_CLASSES });
    }
    Ok(())
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

/// How many values are none: empty, or NaN as other programs write it.
pub(crate) fn missing<S: AsRef<str>>(values: &[S]) -> usize {
    values.iter().filter(|value| is_missing(value.as_ref())).count()
}

pub(crate) fn is_missing(value: &str) -> bool {
    value.is_empty() || value.parse::<f64>().is_ok_and(f64::is_nan)
}

/// Classes that are probably one, in words: names that differ only in case, in spaces around them, in
/// how Unicode composes their letters, or in how a number is written.
pub fn alike(labels: &Labels) -> Vec<String> {
    let plain = |name: &str| number(name).unwrap_or_else(|| caseless(name));
    let mut first: HashMap<String, &str> = HashMap::new();
    let mut found = Vec::new();
    for name in labels.names() {
        match first.entry(plain(name)) {
            Entry::Vacant(entry) => {
                entry.insert(name);
            }
            Entry::Occupied(entry) => found.push(format!(
                "the classes {:?} and {name:?} differ only in how they are written: if they are one \
                 class, write them alike",
                entry.get()
            )),
        }
    }
    found
}

/// Classes that are probably measurements, in words: whole numbers of which hardly any occurs twice.
pub fn measured(labels: &Labels, rows: usize) -> Option<String> {
    const FEWEST: usize = 12;
    let classes = labels.len();
    let is_many = classes >= FEWEST && 2 * classes > rows;
    let is_measured = is_many && labels.names().iter().all(|name| name.parse::<i128>().is_ok());
    is_measured.then(|| {
        format!(
            "{classes} whole numbers are classes of {rows} rows: if they are measurements, no classifier here can \
             learn them; fit a regression on corsmal_feat.load_features(FILE).summary in Python"
        )
    })
}

/// What names have in common that differ only in case, in spaces around them, or in how Unicode composes
/// their letters.
pub(crate) fn caseless(name: &str) -> String {
    let composed: String = name.trim().nfc().collect();
    composed.to_lowercase().nfc().collect()
}

/// A number in one spelling; `None` for other names.
pub(crate) fn number(name: &str) -> Option<String> {
    let name = name.trim();
    if let Ok(whole) = name.parse::<i128>() {
        return Some(whole.to_string());
    }
    let value = name.parse::<f64>().ok().filter(|value| value.is_finite())?;
    // Whole numbers are written without a point, and -0 is 0.
    Some((value + 0.0).to_string())
}

/// The index of each name.
pub(crate) fn positions(names: &[String]) -> HashMap<&str, usize> {
    names.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_that_look_the_same_are_said() {
        for (a, b) in
            [("\u{e9}", "e\u{301}"), ("Rain", "rain"), ("1", "01"), ("1", "1.0 "), ("x", "x ")]
        {
            let found = alike(&Labels::of(&[a, "other", b]).0);
            assert_eq!(found.len(), 1, "{a} {b}");
            assert!(found[0].contains(&format!("{a:?}")) && found[0].contains(&format!("{b:?}")));
        }
        assert!(alike(&Labels::of(&["1", "10", "rain", "ruin", "e", "\u{e9}"]).0).is_empty());
    }

    #[test]
    fn cells_without_a_value_are_counted() {
        assert_eq!(missing(&["", "NaN", "nan", "0", "no", "inf"]), 3);
    }

    #[test]
    fn measurements_are_told_from_classes() {
        let of = |n: usize| Labels::of(&(0..n).map(|i| i.to_string()).collect::<Vec<_>>()).0;
        assert!(measured(&of(57), 60).unwrap().contains("57 whole numbers are classes of 60 rows"));
        assert_eq!((measured(&of(57), 400), measured(&of(5), 6)), (None, None));
        let names = Labels::of(&(0..20).map(|i| format!("x{i}")).collect::<Vec<_>>()).0;
        assert_eq!(measured(&names, 20), None);
    }
}
