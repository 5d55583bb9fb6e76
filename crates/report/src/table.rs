//! Tables of a report.

use serde::{Serialize, Serializer};

use crate::{ReportError, Result};

/// A table whose columns can be sorted.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Name of its files, without extension.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// Headings.
    pub columns: Vec<String>,
    /// Rows of as many cells.
    pub rows: Vec<Row>,
}

/// Whose figures a row holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Computed in this run.
    Ours,
    /// Published.
    Paper,
    /// Computed in this run from predictions of others.
    Added,
}

impl Source {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ours => "ours",
            Self::Paper => "paper",
            Self::Added => "added",
        }
    }
}

/// A row of a table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Whose figures these are.
    pub source: Source,
    /// The cells.
    pub cells: Vec<Cell>,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A score in percent with the interval that it lies in, shown with two decimals and a bar from
    /// 0 to 100.
    Score(f64, Option<(f64, f64)>),
    /// A difference in percentage points, shown with its sign.
    Difference(f64),
    /// A number as it is written.
    Number(f64, String),
    /// Nothing known.
    None,
}

impl Cell {
    /// A score that may be missing, without an interval.
    pub fn score(value: Option<f64>) -> Self {
        value.map_or(Self::None, |v| Self::Score(v, None))
    }

    /// A count.
    pub fn count(n: usize) -> Self {
        Self::Number(n as f64, n.to_string())
    }

    /// Words.
    pub fn text(words: impl Into<String>) -> Self {
        Self::Text(words.into())
    }

    /// The value of a cell that holds a number.
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Score(v, _) | Self::Difference(v) | Self::Number(v, _) => Some(*v),
            Self::Text(_) | Self::None => None,
        }
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Score(value, _) | Self::Difference(value) | Self::Number(value, _) => {
                serializer.serialize_f64(*value)
            }
            Self::None => serializer.serialize_none(),
        }
    }
}

impl Table {
    /// Without columns in which nothing is known.
    #[must_use]
    pub fn without_empty_columns(mut self) -> Self {
        let known = |column: usize| self.rows.iter().any(|row| row.cells[column] != Cell::None);
        let keep: Vec<bool> = (0..self.columns.len()).map(known).collect();
        let mut at = keep.iter();
        self.columns.retain(|_| at.next().copied().unwrap_or(true));
        for row in &mut self.rows {
            let mut at = keep.iter();
            row.cells.retain(|_| at.next().copied().unwrap_or(true));
        }
        self
    }

    /// Whether a column holds numbers.
    pub(crate) fn is_numeric(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().filter_map(|row| row.cells.get(column));
        !cells.any(|cell| matches!(cell, Cell::Text(_)))
    }

    /// Whether some score of a column has an interval.
    fn has_interval(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().filter_map(|row| row.cells.get(column));
        cells.any(|cell| matches!(cell, Cell::Score(_, Some(_))))
    }

    /// The table as CSV. With `sources` its first column says whose figures a row holds; a column of
    /// scores with intervals is followed by their ends.
    pub(crate) fn csv(&self, sources: bool) -> Result<String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let fault = |reason: String| ReportError::Table { name: self.name.clone(), reason };
        let with: Vec<bool> = (0..self.columns.len()).map(|c| self.has_interval(c)).collect();
        let source = |name: &str| if sources { vec![name.to_owned()] } else { Vec::new() };
        let mut header = source("source");
        for (column, with) in self.columns.iter().zip(&with) {
            header.push(column.clone());
            if *with {
                header.extend([format!("{column}, low"), format!("{column}, high")]);
            }
        }
        writer.write_record(&header).map_err(|e| fault(e.to_string()))?;
        for row in &self.rows {
            let mut record = source(row.source.name());
            for (cell, with) in row.cells.iter().zip(&with) {
                record.push(match cell {
                    Cell::Text(text) => text.clone(),
                    Cell::Score(v, _) | Cell::Difference(v) => format!("{v:.4}"),
                    Cell::Number(v, _) => v.to_string(),
                    Cell::None => String::new(),
                });
                if *with {
                    record.extend(match cell {
                        Cell::Score(_, Some((low, high))) => {
                            [format!("{low:.4}"), format!("{high:.4}")]
                        }
                        _ => [String::new(), String::new()],
                    });
                }
            }
            writer.write_record(&record).map_err(|e| fault(e.to_string()))?;
        }
        let bytes = writer.into_inner().map_err(|e| fault(e.to_string()))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_has_the_ends_of_intervals() {
        let row = |cell| Row { source: Source::Ours, cells: vec![Cell::text("a, b"), cell] };
        let table = Table {
            name: "t".into(),
            caption: String::new(),
            columns: vec!["Method".into(), "F1".into()],
            rows: vec![row(Cell::Score(50.0, Some((40.0, 60.0)))), row(Cell::None)],
        };
        assert_eq!(
            table.csv(true).unwrap(),
            "source,Method,F1,\"F1, low\",\"F1, high\"\nours,\"a, b\",50.0000,40.0000,60.0000\n\
             ours,\"a, b\",,,\n"
        );
        assert!(table.csv(false).unwrap().starts_with("Method,F1,"));
        assert!(table.is_numeric(1) && !table.is_numeric(0));
    }
}
