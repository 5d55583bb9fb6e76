//! Writing prediction files.

use std::fmt::Display;
use std::hash::Hash;
use std::io::{self, Write};

use corsmal_files::csv_text;
use serde_json::{Map, Value};

use super::PredictionTable;
use super::UNKNOWN;

/// How lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A header, then a line each.
    Csv,
    /// A JSON object a line.
    JsonLines,
}

/// What a column of a line holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell<'a> {
    /// text
    Text(&'a str),
    /// a time in seconds, written to the nanosecond, so that it names the same frames again
    Seconds(f64),
    /// a number of things
    Count(usize),
    /// nothing: an empty field of CSV, no key in JSON
    Absent,
}

/// Writes lines: columns of the caller, then `predicted` and `p_<label>` for each class.
pub struct PredictionWriter<W> {
    out: W,
    form: Form,
    columns: Vec<String>,
    labels: Vec<String>,
    begun: bool,
}

impl<W: Write> PredictionWriter<W> {
    /// Nothing is written before the first line, so that a refusal leaves nothing behind.
    pub fn new(out: W, form: Form, columns: &[&str], labels: &[String]) -> Self {
        let columns = columns.iter().map(|column| column.to_string()).collect();
        Self { out, form, columns, labels: labels.to_vec(), begun: false }
    }

    /// Writes a line: one cell per column, then the class and the probabilities that there are. A
    /// rejected prediction has probabilities and no class: it is written as `unknown`.
    ///
    /// # Errors
    /// What the output refuses.
    pub fn write(
        &mut self,
        cells: &[Cell<'_>],
        class: Option<usize>,
        proba: Option<&[f64]>,
    ) -> io::Result<()> {
        self.begin()?;
        let rejected = proba.map(|_| UNKNOWN);
        let predicted = class.map(|class| self.labels[class].as_str()).or(rejected);
        let line = match self.form {
            Form::Csv => {
                let mut fields: Vec<String> = cells.iter().map(text).collect();
                fields.push(predicted.unwrap_or_default().into());
                fields.extend((0..self.labels.len()).map(|class| match proba {
                    Some(proba) => proba[class].to_string(),
                    None => String::new(),
                }));
                csv_text::line(&fields)
            }
            Form::JsonLines => {
                let mut object = Map::new();
                for (column, cell) in self.columns.iter().zip(cells) {
                    if let Some(value) = json(cell) {
                        object.insert(column.clone(), value);
                    }
                }
                object.insert("predicted".into(), predicted.into());
                let named = |proba: &[f64]| -> Map<String, Value> {
                    let values = proba.iter().map(|&p| Value::from(p));
                    self.labels.iter().cloned().zip(values).collect()
                };
                object.insert("probabilities".into(), proba.map(named).into());
                format!("{}\n", Value::Object(object)).into_bytes()
            }
        };
        self.out.write_all(&line)?;
        self.out.flush()
    }

    /// Ends the output: one without lines is a header; gives back what was written to.
    ///
    /// # Errors
    /// What the output refuses.
    pub fn finish(mut self) -> io::Result<W> {
        self.begin()?;
        Ok(self.out)
    }

    fn begin(&mut self) -> io::Result<()> {
        if std::mem::replace(&mut self.begun, true) || self.form == Form::JsonLines {
            return Ok(());
        }
        let classes = self.labels.iter().map(|label| format!("p_{label}"));
        let header = self.columns.iter().cloned().chain(["predicted".into()]).chain(classes);
        self.out.write_all(&csv_text::line(&header.collect::<Vec<_>>()))
    }
}

impl<K: Clone + Eq + Hash + Ord + Display> PredictionTable<K> {
    /// The table as CSV.
    ///
    /// # Errors
    /// Text that cannot be written.
    pub fn to_csv(&self) -> io::Result<Vec<u8>> {
        let columns: Vec<&str> = self.columns.iter().map(String::as_str).collect();
        let mut writer = PredictionWriter::new(Vec::new(), Form::Csv, &columns, &self.labels);
        for row in &self.rows {
            let cells: Vec<Cell<'_>> = row.cells.iter().map(|text| Cell::Text(text)).collect();
            writer.write(&cells, row.class, row.proba.as_deref())?;
        }
        writer.finish()
    }
}

fn text(cell: &Cell<'_>) -> String {
    match cell {
        Cell::Text(text) => (*text).to_string(),
        Cell::Seconds(seconds) => rounded(*seconds).to_string(),
        Cell::Count(count) => count.to_string(),
        Cell::Absent => String::new(),
    }
}

fn json(cell: &Cell<'_>) -> Option<Value> {
    match cell {
        Cell::Text(text) => Some((*text).into()),
        Cell::Seconds(seconds) => Some(rounded(*seconds).into()),
        Cell::Count(count) => Some((*count).into()),
        Cell::Absent => None,
    }
}

fn rounded(seconds: f64) -> f64 {
    (seconds * 1e9).round() / 1e9
}
