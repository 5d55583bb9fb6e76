//! Prediction files of other methods.

use std::collections::HashMap;
use std::path::Path;

use super::results::{Estimate, Target};
use crate::error::Result;
use crate::predictions::read_capacities;
use crate::submission::{RowKey, Submission};
use crate::table::Table;

/// Predictions that join the tables.
pub struct Added {
    /// Name in the tables.
    pub name: String,
    by_key: HashMap<RowKey, Estimate>,
}

impl Added {
    /// Reads a submission in an official format, or capacity estimates with columns `fileName`
    /// (`id10_0000.png`: container and sequence number) and `capacity[mL]`.
    ///
    /// # Errors
    /// [`crate::CcmError`] as [`Submission::read`].
    pub fn read(name: &str, path: &Path) -> Result<Self> {
        let table = Table::read(path)?;
        let by_key = if table.find("fileName").is_some() {
            let capacities = read_capacities(path)?.into_iter();
            capacities.map(|(k, capacity_ml)| (k, Estimate { capacity_ml, ..blank(k) })).collect()
        } else {
            submission(&Submission::from_table(&table)?)
        };
        Ok(Self { name: name.to_string(), by_key })
    }

    /// The estimates of these recordings; `None` unless each has one.
    pub(super) fn estimates(&self, targets: &[&Target]) -> Option<Vec<Estimate>> {
        targets
            .iter()
            .map(|t| {
                let by_id = || self.by_key.get(&RowKey::Id(t.annotation.as_ref()?.id?));
                let found = self.by_key.get(&t.key).or_else(by_id)?;
                Some(Estimate { key: t.key, ..found.clone() })
            })
            .collect()
    }
}

fn blank(key: RowKey) -> Estimate {
    Estimate {
        key,
        kind: None,
        level: None,
        kind_probabilities: None,
        level_probabilities: None,
        capacity_ml: None,
    }
}

fn submission(submission: &Submission) -> HashMap<RowKey, Estimate> {
    let class = |value: f64| (value >= 0.0).then_some(value as usize);
    let rows = submission.keys.iter().enumerate().map(|(row, &key)| {
        let level = match submission.level.values[row] {
            50.0 => 1.0,
            90.0 => 2.0,
            other => other,
        };
        let capacity = submission.capacity.values[row];
        let estimate = Estimate {
            kind: class(submission.kind.values[row]),
            level: class(level),
            capacity_ml: (capacity > -1.0).then_some(capacity),
            ..blank(key)
        };
        (key, estimate)
    });
    rows.collect()
}
