//! Reading and checking submissions, and joining them to annotations.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::{Estimates, Format, RowKey, Submission};
use crate::dataset::{Annotation, Annotations};
use crate::error::{CcmError, Result};
use crate::table::Table;

/// Columns of the 2022 format that scores are computed from, in the order of
/// [`Submission::columns_mut`].
const SCORED: [&str; 10] = [
    "Filling type",
    "Filling level",
    "Container capacity",
    "Container mass",
    "Width at the top",
    "Width at the bottom",
    "Height",
    "Object safety",
    "Distance",
    "Angle difference",
];

impl Submission {
    /// Reads a submission in either official format.
    ///
    /// # Errors
    /// [`CcmError`] for an unreadable table, a missing column, a value that is not a number or no
    /// label, and duplicate rows.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?)
    }

    pub(crate) fn from_table(table: &Table) -> Result<Self> {
        let format = if table.find("Configuration ID").is_some() {
            Format::Y2022
        } else if table.find("Container ID").is_some() {
            Format::Y2020
        } else {
            return Err(CcmError::Column {
                path: table.path().to_path_buf(),
                column: "Configuration ID' (2022 format) or 'Container ID".into(),
                header: table.header().join(", "),
            });
        };
        let mut submission = Self {
            path: table.path().to_path_buf(),
            format,
            keys: read_keys(table, format)?,
            kind: Estimates::default(),
            level: Estimates::default(),
            capacity: Estimates::default(),
            container_mass: Estimates::default(),
            width_top: Estimates::default(),
            width_bottom: Estimates::default(),
            height: Estimates::default(),
            safety: Estimates::default(),
            distance: Estimates::default(),
            angle: Estimates::default(),
            notes: Vec::new(),
        };
        let in_2020 = 3;
        for (i, column) in submission.columns_mut().into_iter().enumerate() {
            *column = if i < in_2020 || format == Format::Y2022 {
                read_estimates(table, SCORED[i], i < 2)?
            } else {
                Estimates { values: vec![-1.0; table.rows()], float: false }
            };
        }
        for (name, column) in [("type", &submission.kind), ("level", &submission.level)] {
            if column.float && column.addressed() {
                submission.notes.push(format!(
                    "filling {name} is written as floating-point numbers; by the rules of the \
                     official evaluators labels are compared as text, where '1.0' never equals '1'"
                ));
            }
        }
        Ok(submission)
    }

    /// The rows in the order of the annotations.
    ///
    /// Rows of recordings that `all` has but `wanted` (a part of it) has not are left out. The
    /// official evaluators pair rows by position without looking at the ids; on files in the
    /// official order the result is the same.
    ///
    /// # Errors
    /// [`CcmError::Rows`] for missing rows and for rows that `all` does not have.
    pub fn align(&self, wanted: &Annotations, all: &Annotations) -> Result<Self> {
        let key = |row: &Annotation| match self.format {
            Format::Y2022 => row.id.map(RowKey::Id),
            Format::Y2020 => row.sequence.map(|s| RowKey::Sequence(row.container, s)),
        };
        let keys_of = |annotations: &Annotations| -> Result<Vec<RowKey>> {
            let keys: Option<Vec<_>> = annotations.rows.iter().map(key).collect();
            keys.ok_or_else(|| {
                CcmError::Request(format!(
                    "{}: rows named by {} cannot be found in {}, which has no such column; use \
                     annotations of the matching release",
                    self.path.display(),
                    match self.format {
                        Format::Y2022 => "'Configuration ID'",
                        Format::Y2020 => "'Container ID' and 'Sequence'",
                    },
                    annotations.path.display()
                ))
            })
        };
        let at: HashMap<_, _> = self.keys.iter().enumerate().map(|(i, &k)| (k, i)).collect();
        let wanted_keys = keys_of(wanted)?;
        let missing: Vec<_> = wanted_keys.iter().filter(|k| !at.contains_key(k)).collect();
        if !missing.is_empty() {
            return Err(self.rows_error("missing rows", &missing, wanted));
        }
        let known: HashSet<_> = keys_of(all)?.into_iter().collect();
        let extra: Vec<_> = self.keys.iter().filter(|k| !known.contains(k)).collect();
        if !extra.is_empty() {
            return Err(self.rows_error("rows that the annotations lack", &extra, all));
        }
        let rows: Vec<_> = wanted_keys.iter().map(|k| at[k]).collect();
        Ok(self.select(&rows))
    }

    fn rows_error(&self, problem: &'static str, keys: &[&RowKey], of: &Annotations) -> CcmError {
        CcmError::Rows {
            path: self.path.clone(),
            problem,
            rows: listed(keys),
            expected: format!("the {} recordings of {}", of.rows.len(), of.path.display()),
        }
    }
}

/// The first five and how many more there are.
pub(crate) fn listed(keys: &[&RowKey]) -> String {
    let mut text: Vec<String> = keys.iter().take(5).map(|k| k.to_string()).collect();
    if keys.len() > 5 {
        text.push(format!("and {} more", keys.len() - 5));
    }
    text.join(", ")
}

fn read_keys(table: &Table, format: Format) -> Result<Vec<RowKey>> {
    let (id, sequence) = match format {
        Format::Y2022 => (table.column("Configuration ID")?, None),
        Format::Y2020 => (table.column("Container ID")?, Some(table.column("Sequence")?)),
    };
    let mut keys = Vec::with_capacity(table.rows());
    let mut seen = HashSet::new();
    for row in 0..table.rows() {
        let number = table.integer(row, id)?;
        let key = match sequence {
            None => RowKey::Id(
                u32::try_from(number).map_err(|_| table.fault(row, id, "a number from 0"))?,
            ),
            Some(sequence) => RowKey::Sequence(
                u8::try_from(number).map_err(|_| table.fault(row, id, "a container number"))?,
                u16::try_from(table.integer(row, sequence)?)
                    .map_err(|_| table.fault(row, sequence, "a sequence number"))?,
            ),
        };
        if !seen.insert(key) {
            return Err(CcmError::Rows {
                path: table.path().to_path_buf(),
                problem: "more than one row",
                rows: key.to_string(),
                expected: "the recordings".into(),
            });
        }
        keys.push(key);
    }
    if keys.is_empty() {
        return Err(CcmError::Table {
            path: table.path().to_path_buf(),
            reason: "it has a header but no rows".into(),
        });
    }
    Ok(keys)
}

fn read_estimates(table: &Table, name: &str, labels: bool) -> Result<Estimates> {
    let column = table.column(name)?;
    let mut estimates = Estimates::default();
    for row in 0..table.rows() {
        let value = table.number(row, column)?;
        if labels {
            let allowed: &[f64] = if name == "Filling type" {
                &[-1.0, 0.0, 1.0, 2.0, 3.0]
            } else {
                &[-1.0, 0.0, 1.0, 2.0, 50.0, 90.0]
            };
            if !allowed.contains(&value) {
                return Err(table.fault(
                    row,
                    column,
                    if name == "Filling type" {
                        "a filling type (0, 1, 2, 3, or -1 if not estimated)"
                    } else {
                        "a filling level (0, 1, 2, or 0, 50, 90, or -1 if not estimated)"
                    },
                ));
            }
        }
        estimates.float |= table.text(row, column).parse::<i64>().is_err();
        estimates.values.push(value);
    }
    Ok(estimates)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submission(text: &str) -> Result<Submission> {
        Submission::from_table(&Table::parse(text.as_bytes(), Path::new("s.csv")).unwrap())
    }

    const HEADER: &str = "Container ID,Sequence,Filling type,Filling level,Container Capacity\n";

    #[test]
    fn reads_the_2020_format_in_any_column_order() {
        let text =
            "Container ID,Sequence,Container Capacity,Filling level,Filling type\n1,0,-1,2,3\n";
        let s = submission(text).unwrap();
        assert_eq!(s.format, Format::Y2020);
        assert_eq!((s.kind.values[0], s.level.values[0]), (3.0, 2.0));
        assert!(!s.capacity.addressed());
        assert!(!s.height.addressed());
    }

    #[test]
    fn faults_name_line_and_column() {
        let cases = [
            ("1,0,7,0,1\n", "line 2, column 'Filling type': '7'"),
            ("1,0,0,0,1\n1,1,0,1.5,1\n", "line 3, column 'Filling level': '1.5'"),
            ("1,0,0,0,nan\n", "'nan' is not a finite number"),
            ("1,0,0,0,1\n1,0,0,0,1\n", "more than one row: container 1 sequence 0"),
            ("1,0.5,0,0,1\n", "'0.5' is not a whole number"),
            ("", "no rows"),
        ];
        for (rows, message) in cases {
            let error = submission(&format!("{HEADER}{rows}")).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
        let error = submission("a,b\n1,2\n").unwrap_err().to_string();
        assert!(error.contains("Configuration ID") && error.contains("a, b"), "{error}");
    }

    #[test]
    fn float_labels_are_read_and_noted() {
        let s = submission(&format!("{HEADER}1,0,1.0,1,9.5\n")).unwrap();
        assert!(s.kind.float && !s.level.float && s.capacity.float);
        assert_eq!(s.notes.len(), 1);
        let s = submission(&format!("{HEADER}1,0,-1.0,1,9.5\n")).unwrap();
        assert!(s.notes.is_empty());
        // pandas reads these as whole numbers.
        let s = submission(&format!("{HEADER}1,0,+1,02,9.5\n")).unwrap();
        assert!(!s.kind.float && !s.level.float);
        assert_eq!((s.kind.values[0], s.level.values[0]), (1.0, 2.0));
    }
}
