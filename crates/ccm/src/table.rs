//! Reading a small CSV table with the place of every fault.

use std::path::{Path, PathBuf};

use corsmal_files::{content, csv_text};

use crate::error::{CcmError, Result};

/// Largest table that is read; the official ones have under 70 kB.
const MAX_BYTES: u64 = 64 << 20;

/// A table held as text: header, rows and the line each row came from.
pub(crate) struct Table {
    path: PathBuf,
    header: Vec<String>,
    rows: Vec<(usize, csv::StringRecord)>,
}

impl Table {
    /// Reads a file.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = content::read(path, MAX_BYTES).map_err(|e| CcmError::io(path, e))?;
        Self::parse(&bytes, path)
    }

    /// Parses bytes; `path` is named in errors.
    pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let fault = |reason: String| CcmError::Table { path: path.to_path_buf(), reason };
        let mut reader = csv_text::reader(bytes).map_err(|e| fault(e.to_string()))?;
        let header = csv_text::header(&mut reader).map_err(|e| fault(e.to_string()))?;
        let header: Vec<String> = header.iter().map(str::to_string).collect();
        if header.iter().all(String::is_empty) {
            return Err(fault("it is empty; a header line is needed".into()));
        }
        // Columns are found ignoring case: the first of two would count, whatever the other says.
        if let Some(name) = csv_text::repeated(header.iter().map(|h| h.to_ascii_lowercase())) {
            return Err(fault(format!(
                "two columns are named {name:?} (case is ignored); rename one"
            )));
        }
        let rows = csv_text::records(&mut reader)
            .map(|found| found.map(|(line, record)| (line as usize, record)))
            .collect::<std::result::Result<_, csv_text::Fault>>()
            .map_err(|e| fault(e.to_string()))?;
        Ok(Self { path: path.to_path_buf(), header, rows })
    }

    pub(crate) fn header(&self) -> &[String] {
        &self.header
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Index of a column by name, ignoring case.
    pub(crate) fn find(&self, column: &str) -> Option<usize> {
        self.header.iter().position(|h| h.eq_ignore_ascii_case(column))
    }

    /// Index of a column that must be there.
    pub(crate) fn column(&self, column: &str) -> Result<usize> {
        self.find(column).ok_or_else(|| CcmError::Column {
            path: self.path.clone(),
            column: column.to_string(),
            header: self.header.join(", "),
        })
    }

    /// Text of a cell.
    pub(crate) fn text(&self, row: usize, column: usize) -> &str {
        self.rows[row].1.get(column).unwrap_or_default()
    }

    /// A finite number.
    pub(crate) fn number(&self, row: usize, column: usize) -> Result<f64> {
        match self.text(row, column).trim().parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(v),
            _ => Err(self.fault(row, column, "a finite number")),
        }
    }

    /// A whole number; `1.0` counts as 1.
    pub(crate) fn integer(&self, row: usize, column: usize) -> Result<i64> {
        let value = self.number(row, column)?;
        if value.fract() != 0.0 || value.abs() > 1e9 {
            return Err(self.fault(row, column, "a whole number"));
        }
        Ok(value as i64)
    }

    /// Line in the file of a row, the header being line 1.
    pub(crate) fn line(&self, row: usize) -> usize {
        self.rows[row].0
    }

    /// The error for a cell with a value that is not allowed.
    pub(crate) fn fault(&self, row: usize, column: usize, expected: &'static str) -> CcmError {
        CcmError::Value {
            path: self.path.clone(),
            line: self.line(row),
            column: self.header[column].clone(),
            value: self.text(row, column).to_string(),
            expected,
        }
    }
}
