//! The table of a run: one outcome per input and, for each input with features, its id, labels and
//! summary row. Rows enter whole, so names and numbers cannot slip out of step.

use std::collections::HashSet;

use ndarray::ArrayView2;
use thiserror::Error;

use crate::growth::make_room;
use crate::outcome::Outcome;

/// Prefix of an output's own arrays; no id begins with it.
pub const RESERVED: &str = "__";

/// Name of the id column.
pub const ID: &str = "id";
/// What other programs call a column of ids, the likelier name first.
pub const ID_NAMES: [&str; 2] = [ID, "ids"];

/// What a table refuses.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TableError {
    /// A row does not fit the columns.
    #[error("{id}: expected {expected} summary values, found {actual}")]
    Row {
        /// The input.
        id: String,
        /// Columns of the table.
        expected: usize,
        /// Values given.
        actual: usize,
    },
    /// The rows are not those of the recordings with features.
    #[error(
        "row {row} of the table is of {actual:?}, expected {expected:?}: the ids do not fit the outcomes, so the file was changed after it was written"
    )]
    Id {
        /// The row, from 0.
        row: usize,
        /// Id of the recording in the outcomes; empty where there is none.
        expected: String,
        /// Id of the row; empty where there is none.
        actual: String,
    },
    /// Labels do not fit the columns.
    #[error("{id}: expected the label columns {expected:?}, found {actual:?}")]
    Labels {
        /// The input.
        id: String,
        /// Label columns of the table.
        expected: Vec<String>,
        /// Names given.
        actual: Vec<String>,
    },
    /// Two columns would have one name.
    #[error("two columns of the table are named {name:?}")]
    Column {
        /// The name.
        name: String,
    },
    /// The features are already named otherwise.
    #[error(
        "the table has {expected} features, the first {first:?}; a row with {actual} other features does not fit"
    )]
    Renamed {
        /// First feature of the table.
        first: String,
        /// Features of the table.
        expected: usize,
        /// Features given.
        actual: usize,
    },
}

/// Ids, labels, summary rows and outcomes, in the order of the inputs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    feature_names: Vec<String>,
    label_columns: Vec<String>,
    ids: Vec<String>,
    /// One list per column.
    labels: Vec<Vec<String>>,
    /// Row after row.
    values: Vec<f32>,
    outcomes: Vec<Outcome>,
}

impl Table {
    /// An empty table with these label columns and no features yet.
    ///
    /// # Errors
    /// [`TableError::Column`] when a label column is called `id` or like another.
    pub fn new(label_columns: Vec<String>) -> Result<Self, TableError> {
        let labels = vec![Vec::new(); label_columns.len()];
        let table = Self { label_columns, labels, ..Self::default() };
        table.check_columns(&[])?;
        Ok(table)
    }

    /// Names the columns of the summary, once they are known (they depend on the channel count of
    /// the first recording). Naming them again alike changes nothing.
    ///
    /// # Errors
    /// [`TableError::Renamed`] when they have other names already; [`TableError::Column`] when a
    /// name is taken by another column.
    pub fn name_features(&mut self, names: &[String]) -> Result<(), TableError> {
        if self.feature_names == names {
            return Ok(());
        }
        if let Some(first) = self.feature_names.first() {
            let (expected, actual) = (self.feature_names.len(), names.len());
            return Err(TableError::Renamed { first: first.clone(), expected, actual });
        }
        self.check_columns(names)?;
        self.feature_names = names.to_vec();
        Ok(())
    }

    /// Appends an input: its outcome and, if that has features, its id, labels and summary row
    /// (empty when the run has no summaries). Without features, the outcome keeps the labels.
    ///
    /// # Errors
    /// [`TableError::Row`] or [`TableError::Labels`] when they do not fit; the table is unchanged.
    pub fn push(
        &mut self,
        mut outcome: Outcome,
        labels: &[(String, String)],
        row: &[f32],
    ) -> Result<(), TableError> {
        if outcome.status.has_features() {
            if row.len() != self.feature_names.len() {
                let (expected, actual) = (self.feature_names.len(), row.len());
                return Err(TableError::Row { id: outcome.id, expected, actual });
            }
            if !labels.iter().map(|(name, _)| name).eq(&self.label_columns) {
                return Err(TableError::Labels {
                    id: outcome.id,
                    expected: self.label_columns.clone(),
                    actual: labels.iter().map(|(name, _)| name.clone()).collect(),
                });
            }
            make_room(&mut self.ids, 1);
            self.ids.push(outcome.id.clone());
            make_room(&mut self.values, row.len());
            self.values.extend_from_slice(row);
            for (column, (_, value)) in self.labels.iter_mut().zip(labels) {
                make_room(column, 1);
                column.push(value.clone());
            }
        } else {
            outcome.labels.extend(labels.iter().cloned());
        }
        make_room(&mut self.outcomes, 1);
        self.outcomes.push(outcome);
        Ok(())
    }

    /// Appends all inputs of another table with the same columns.
    ///
    /// # Errors
    /// As [`Table::name_features`] and [`Table::push`].
    pub fn extend(&mut self, other: &Self) -> Result<(), TableError> {
        if !other.ids.is_empty() {
            self.name_features(&other.feature_names)?;
        }
        let mut rows = 0..other.ids.len();
        for outcome in &other.outcomes {
            let row = if outcome.status.has_features() { rows.next() } else { None };
            let labels: Vec<(String, String)> = match row {
                Some(row) => {
                    other.labels().map(|(name, c)| (name.into(), c[row].clone())).collect()
                }
                None => Vec::new(),
            };
            let width = other.feature_names.len();
            let values = row.map_or(&[][..], |row| &other.values[row * width..][..width]);
            self.push(outcome.clone(), &labels, values)?;
        }
        Ok(())
    }

    /// The inputs at some places, in that order, without one of the label columns.
    pub(crate) fn of_places(&self, places: &[usize], without: &str) -> Result<Self, TableError> {
        let kept = |name: &&String| *name != without;
        let mut part = Self::new(self.label_columns.iter().filter(kept).cloned().collect())?;
        part.name_features(&self.feature_names)?;
        // The row of each outcome that has one.
        let mut rows = Vec::with_capacity(self.outcomes.len());
        let mut next = 0;
        for outcome in &self.outcomes {
            rows.push(next);
            next += usize::from(outcome.status.has_features());
        }
        let width = self.feature_names.len();
        for &place in places {
            let (outcome, row) = (&self.outcomes[place], rows[place]);
            if !outcome.status.has_features() {
                let mut outcome = outcome.clone();
                outcome.labels.remove(without);
                part.push(outcome, &[], &[])?;
                continue;
            }
            let labels = self.labels().filter(|(name, _)| *name != without);
            let labels: Vec<(String, String)> =
                labels.map(|(name, column)| (name.to_owned(), column[row].clone())).collect();
            part.push(outcome.clone(), &labels, &self.values[row * width..][..width])?;
        }
        Ok(part)
    }

    /// Puts a table together from what a reader found.
    ///
    /// # Errors
    /// [`TableError::Id`] when rows and outcomes disagree, [`TableError::Row`] with the id `table` when
    /// counts do, [`TableError::Column`].
    pub(crate) fn from_parts(
        ids: Vec<String>,
        feature_names: Vec<String>,
        values: Vec<f32>,
        labels: Vec<(String, Vec<String>)>,
        outcomes: Vec<Outcome>,
    ) -> Result<Self, TableError> {
        let mut with_features =
            outcomes.iter().filter(|o| o.status.has_features()).map(|o| &o.id).fuse();
        let mut rows = ids.iter().fuse();
        for row in 0.. {
            match (with_features.next(), rows.next()) {
                (None, None) => break,
                (expected, actual) if expected == actual => {}
                (expected, actual) => {
                    let text = |id: Option<&String>| id.cloned().unwrap_or_default();
                    let (expected, actual) = (text(expected), text(actual));
                    return Err(TableError::Id { row, expected, actual });
                }
            }
        }
        let wrong = |expected, actual| TableError::Row { id: "table".into(), expected, actual };
        if Some(values.len()) != ids.len().checked_mul(feature_names.len()) {
            return Err(wrong(feature_names.len() * ids.len(), values.len()));
        }
        if let Some((_, column)) = labels.iter().find(|(_, column)| column.len() != ids.len()) {
            return Err(wrong(ids.len(), column.len()));
        }
        let (label_columns, labels) = labels.into_iter().unzip();
        let table = Self { feature_names, label_columns, ids, labels, values, outcomes };
        table.check_columns(&table.feature_names)?;
        Ok(table)
    }

    /// Ids of the rows.
    pub fn ids(&self) -> &[String] {
        &self.ids
    }

    /// Names of the summary's columns.
    pub fn feature_names(&self) -> &[String] {
        &self.feature_names
    }

    /// Label columns as (name, one value per row).
    pub fn labels(&self) -> impl Iterator<Item = (&str, &[String])> {
        self.label_columns.iter().map(String::as_str).zip(self.labels.iter().map(Vec::as_slice))
    }

    /// The summary, `[rows, features]`.
    pub fn values(&self) -> ArrayView2<'_, f32> {
        let shape = (self.ids.len(), self.feature_names.len());
        ArrayView2::from_shape(shape, &self.values).expect("every row is as long as the names")
    }

    /// One outcome per input, failed ones included.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// The outcomes alone.
    pub fn into_outcomes(self) -> Vec<Outcome> {
        self.outcomes
    }

    fn check_columns(&self, features: &[String]) -> Result<(), TableError> {
        let mut taken = HashSet::from([ID]);
        for name in self.label_columns.iter().chain(features) {
            if !taken.insert(name) {
                return Err(TableError::Column { name: name.clone() });
            }
        }
        Ok(())
    }
}
