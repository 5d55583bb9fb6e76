//! A report of results: one self-contained HTML page, and the same tables as CSV and JSON.

mod figure;
mod html;

use std::path::Path;

use corsmal_files::draft;
use serde::{Serialize, Serializer};

use crate::error::{CcmError, Result};

pub use figure::classes;

/// What a person reads.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Heading.
    pub title: String,
    /// One sentence below it.
    pub summary: String,
    /// A warning that must not be missed, such as that the data are synthetic.
    pub warning: Option<String>,
    /// Name and value of what was used: data, protocol, versions.
    pub facts: Vec<(String, String)>,
    /// The results.
    pub sections: Vec<Section>,
}

/// A part of the report.
#[derive(Clone, Debug, Serialize)]
pub struct Section {
    /// Name in links and files: letters, digits and hyphens.
    pub id: String,
    /// Heading.
    pub title: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Pictures; the first group is shown, the others unfold.
    pub figures: Vec<FigureGroup>,
}

/// Pictures that belong together.
#[derive(Clone, Debug, Serialize)]
pub struct FigureGroup {
    /// Heading.
    pub title: String,
    /// The pictures.
    pub figures: Vec<Figure>,
}

/// A table whose columns can be sorted.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Name of its CSV file, without extension.
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
    /// Computed here.
    Ours,
    /// Printed in the paper.
    Paper,
    /// Computed here from predictions of others.
    Added,
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
    /// A score in percent, shown with two decimals and a bar.
    Score(f64),
    /// A difference in percent points, shown with its sign.
    Difference(f64),
    /// Nothing known.
    None,
}

/// A picture with what it shows.
#[derive(Clone, Debug, Serialize)]
pub struct Figure {
    /// What it shows.
    pub caption: String,
    /// Takes two places where there is room.
    #[serde(skip)]
    pub wide: bool,
    /// SVG elements that take their colours from the page.
    #[serde(skip)]
    pub svg: String,
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Score(value) | Self::Difference(value) => serializer.serialize_f64(*value),
            Self::None => serializer.serialize_none(),
        }
    }
}

impl Cell {
    /// A score that may be missing.
    pub fn score(value: Option<f64>) -> Self {
        value.map_or(Self::None, Self::Score)
    }
}

impl Report {
    /// The page: no other file is needed to read it.
    pub fn html(&self) -> String {
        html::page(self)
    }

    /// Writes `report.html`, `report.json` and `tables/<name>.csv` below `dir`.
    ///
    /// # Errors
    /// [`CcmError::Io`] when something cannot be written.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let tables = dir.join("tables");
        std::fs::create_dir_all(&tables).map_err(|e| CcmError::io(&tables, e))?;
        let put = |path: &Path, bytes: &[u8]| draft::write(path, bytes).map_err(CcmError::Write);
        for table in self.sections.iter().flat_map(|s| &s.tables) {
            put(&tables.join(format!("{}.csv", table.name)), table.csv()?.as_bytes())?;
        }
        let json = serde_json::to_string_pretty(self)
            .map_err(|e| CcmError::Request(format!("report as JSON: {e}")))?;
        put(&dir.join("report.json"), json.as_bytes())?;
        put(&dir.join("report.html"), self.html().as_bytes())
    }
}

impl Table {
    /// Without columns in which nothing is known.
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

    /// The table as CSV, with a first column that says whose figures a row holds.
    fn csv(&self) -> Result<String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let fault = |e: csv::Error| CcmError::Request(format!("table {}: {e}", self.name));
        let header = std::iter::once("source").chain(self.columns.iter().map(String::as_str));
        writer.write_record(header).map_err(fault)?;
        for row in &self.rows {
            let source = match row.source {
                Source::Ours => "ours",
                Source::Paper => "paper",
                Source::Added => "added",
            };
            let cells = row.cells.iter().map(|cell| match cell {
                Cell::Text(text) => text.clone(),
                Cell::Score(v) | Cell::Difference(v) => format!("{v:.4}"),
                Cell::None => String::new(),
            });
            writer.write_record(std::iter::once(source.to_string()).chain(cells)).map_err(fault)?;
        }
        let bytes = writer.into_inner().map_err(|e| CcmError::Request(e.to_string()))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}
