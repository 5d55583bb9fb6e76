//! Tables of class probabilities per recording, and their late fusion.
//!
//! The format is that of M5's published files: columns naming the recording (`Object,Sequence`,
//! or `id`, or `container,sequence`), then `p0`, `p1`, … one per class.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use ndarray::{Array2, ArrayView1};

use crate::dataset::{Container, SequenceName};
use crate::error::{CcmError, Result};
use crate::submission::RowKey;
use crate::table::Table;

/// Class probabilities of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbabilityTable {
    /// Where they were read from.
    pub path: PathBuf,
    /// The recordings, in the order of the file.
    pub keys: Vec<RowKey>,
    /// One row of probabilities per recording, all of one length.
    pub rows: Vec<Vec<f64>>,
}

impl ProbabilityTable {
    /// Reads a table.
    ///
    /// # Errors
    /// [`CcmError`] for missing columns, sequences that are neither numbers nor names of the data
    /// set, negative or non-finite probabilities, and duplicate rows.
    pub fn read(path: &Path) -> Result<Self> {
        let table = Table::read(path)?;
        let id = table.find("id").or_else(|| table.find("Configuration ID"));
        let container = ["container", "Object", "Container ID"].iter().find_map(|n| table.find(n));
        let classes: Vec<usize> = (0..).map_while(|c| table.find(&format!("p{c}"))).collect();
        if classes.len() < 2 {
            table.column("p0")?;
            table.column("p1")?;
        }
        let mut keys = Vec::with_capacity(table.rows());
        let mut rows = Vec::with_capacity(table.rows());
        let mut seen = std::collections::HashSet::new();
        for row in 0..table.rows() {
            let key = match (container, id) {
                (Some(container), _) => {
                    sequence_key(&table, row, container, table.column("sequence")?)?
                }
                (None, Some(id)) => RowKey::Id(
                    u32::try_from(table.integer(row, id)?)
                        .map_err(|_| table.fault(row, id, "a number from 0"))?,
                ),
                (None, None) => {
                    return Err(CcmError::Column {
                        path: path.to_path_buf(),
                        column: "id' or 'container' and 'sequence".into(),
                        header: table.header().join(", "),
                    });
                }
            };
            if !seen.insert(key) {
                return Err(CcmError::Rows {
                    path: path.to_path_buf(),
                    problem: "more than one row",
                    rows: key.to_string(),
                    expected: "the recordings".into(),
                });
            }
            keys.push(key);
            let mut values = Vec::with_capacity(classes.len());
            for &class in &classes {
                let p = table.number(row, class)?;
                if p < 0.0 {
                    return Err(table.fault(row, class, "a probability"));
                }
                values.push(p);
            }
            rows.push(values);
        }
        Ok(Self { path: path.to_path_buf(), keys, rows })
    }

    /// Weighted mean of tables over the same recordings, in the order of the first.
    ///
    /// # Errors
    /// [`CcmError`] for no tables, weights that are not one positive number per table, other
    /// numbers of classes, and rows that one table has and another has not.
    pub fn average(tables: &[Self], weights: Option<&[f64]>) -> Result<Self> {
        let Some(first) = tables.first() else {
            return Err(CcmError::Request("no prediction files to average".into()));
        };
        let mut aligned = Vec::with_capacity(tables.len());
        for table in tables {
            aligned.push(table.aligned_to(first)?);
        }
        let equal = vec![1.0; tables.len()];
        let views: Vec<_> = aligned.iter().map(|a| a.view()).collect();
        let mean = corsmal_models::fusion::average(&views, weights.unwrap_or(&equal))
            .map_err(|e| CcmError::Request(format!("fusion by averaging: {e}")))?;
        let rows = mean.outer_iter().map(|r| r.to_vec()).collect();
        Ok(Self { path: first.path.clone(), keys: first.keys.clone(), rows })
    }

    /// The rows in the order of another table, which must have the same ones.
    fn aligned_to(&self, other: &Self) -> Result<Array2<f64>> {
        let at: HashMap<_, _> = self.keys.iter().zip(&self.rows).collect();
        let classes = other.rows.first().map_or(0, Vec::len);
        let mut aligned = Array2::zeros((other.keys.len(), classes));
        for (key, mut to) in other.keys.iter().zip(aligned.outer_iter_mut()) {
            let row =
                at.get(key).filter(|row| row.len() == classes && at.len() == other.keys.len());
            let Some(row) = row else {
                return Err(CcmError::Rows {
                    path: self.path.clone(),
                    problem: "rows or classes other than in the first file",
                    rows: format!("{} rows, looking for {key}", at.len()),
                    expected: format!(
                        "the {} recordings of {} with {classes} classes",
                        other.keys.len(),
                        other.path.display()
                    ),
                });
            };
            to.assign(&ArrayView1::from(row.as_slice()));
        }
        Ok(aligned)
    }

    /// The most probable class of each recording, the lowest where several are equal.
    pub fn top(&self) -> Vec<usize> {
        self.rows
            .iter()
            .map(|row| (0..row.len()).fold(0, |best, c| if row[c] > row[best] { c } else { best }))
            .collect()
    }
}

/// The recording named by container and sequence, the latter a number or a name.
fn sequence_key(table: &Table, row: usize, container: usize, sequence: usize) -> Result<RowKey> {
    let number = u8::try_from(table.integer(row, container)?)
        .map_err(|_| table.fault(row, container, "a container number"))?;
    let text = table.text(row, sequence);
    let position = text.parse().ok().or_else(|| {
        Container::new(number).zip(SequenceName::parse(text)).and_then(|(c, name)| name.number(c))
    });
    match position {
        Some(position) => Ok(RowKey::Sequence(number, position)),
        None => {
            Err(table.fault(row, sequence, "a sequence number or name such as s0_fi1_fu2_b0_l0"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[[f64; 2]]) -> ProbabilityTable {
        ProbabilityTable {
            path: "t.csv".into(),
            keys: (0..rows.len() as u32).map(RowKey::Id).collect(),
            rows: rows.iter().map(|r| r.to_vec()).collect(),
        }
    }

    #[test]
    fn averages_by_row_name_with_weights() {
        let a = table(&[[0.9, 0.1], [0.4, 0.6]]);
        let mut b = table(&[[0.8, 0.2], [0.1, 0.9]]);
        b.keys.reverse();
        let mean = ProbabilityTable::average(&[a, b], Some(&[1.0, 3.0])).unwrap();
        assert!((mean.rows[0][0] - (0.9 + 3.0 * 0.1) / 4.0).abs() < 1e-12);
        assert_eq!(mean.top(), [1, 0]);
    }

    #[test]
    fn refuses_other_rows_and_weights() {
        let (a, b) = (table(&[[1.0, 0.0], [1.0, 0.0]]), table(&[[1.0, 0.0]]));
        let error = ProbabilityTable::average(&[a.clone(), b], None).unwrap_err().to_string();
        assert!(error.contains("1 rows"), "{error}");
        assert!(ProbabilityTable::average(&[a.clone(), a], Some(&[1.0])).is_err());
        assert!(ProbabilityTable::average(&[], None).is_err());
    }
}
