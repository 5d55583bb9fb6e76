//! Inspection of tables of text: predictions, submissions, capacities, detections, labels.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::ExitCode;

use corsmal_files::csv_text;
use serde::Serialize;

use super::refusal::{corrupt, to_json};
use crate::failure::Failure;
use crate::plural::plural;

/// Columns whose values are counted, of tables that have all of the columns named before.
const COUNTED: [(&[&str], &[&str]); 5] = [
    (&[], &["status", "predicted", "true", "fold"]),
    (&["fileName", "capacity[mL]"], &["method"]),
    (&["frame", "view", "label", "score"], &["view", "label"]),
    (&["Configuration ID"], &["Filling type", "Filling level"]),
    (&["Container ID", "Sequence"], &["Filling type", "Filling level"]),
];

/// What a table is, by the columns that it has.
const KINDS: [(&str, &[&str]); 6] = [
    ("capacities", &["fileName", "capacity[mL]"]),
    ("table of detections", &["frame", "view", "label", "score"]),
    ("submission in the format of 2022", &["Configuration ID", "Filling type", "Filling level"]),
    ("submission in the format of 2020", &["Container ID", "Sequence", "Filling type"]),
    ("predictions", &["id", "predicted"]),
    ("table", &[]),
];

/// What is shown of a table.
#[derive(Serialize)]
pub(super) struct Contents {
    path: String,
    format: &'static str,
    kind: &'static str,
    rows: usize,
    columns: Vec<String>,
    /// Rows of each value of the columns that have few.
    counts: BTreeMap<String, BTreeMap<String, usize>>,
    /// Share of right predictions, where the table has true classes.
    accuracy: Option<f64>,
}

/// Counts the rows of a table as they come.
pub(super) struct Counter {
    columns: Vec<String>,
    counts: BTreeMap<String, BTreeMap<String, usize>>,
    rows: usize,
    scored: usize,
    right: usize,
}

impl Counter {
    /// For a table with these columns.
    pub(super) fn new(columns: Vec<String>) -> Self {
        let has = |names: &[&str]| names.iter().all(|name| columns.iter().any(|c| c == name));
        let counted = COUNTED.iter().filter(|(of, _)| has(of)).flat_map(|(_, counted)| *counted);
        let counts = counted.filter(|name| has(&[name]));
        let counts = counts.map(|name| ((*name).to_owned(), BTreeMap::new())).collect();
        Self { columns, counts, rows: 0, scored: 0, right: 0 }
    }

    /// Takes in a row, given its value in a column; empty where it has none.
    pub(super) fn add(&mut self, value: impl Fn(&str) -> String) {
        self.rows += 1;
        for (column, values) in &mut self.counts {
            *values.entry(value(column)).or_default() += 1;
        }
        if self.counts.contains_key("true") && self.counts.contains_key("predicted") {
            let truth = value("true");
            self.scored += usize::from(!truth.is_empty());
            self.right += usize::from(!truth.is_empty() && truth == value("predicted"));
        }
    }

    /// What was counted.
    pub(super) fn finish(self, path: &Path, format: &'static str) -> Contents {
        let Self { columns, counts, rows, scored, right } = self;
        let accuracy = (scored > 0).then(|| right as f64 / scored as f64);
        let has = |names: &[&str]| names.iter().all(|name| columns.iter().any(|c| c == name));
        let kind = KINDS.iter().find(|(_, of)| has(of)).map_or("table", |(kind, _)| *kind);
        let path = path.display().to_string();
        Contents { path, format, kind, rows, columns, counts, accuracy }
    }
}

/// Prints what a table has: of predictions, how many of each class and how many are right.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    match read(path) {
        Ok(contents) => contents.print(json),
        Err(error) => corrupt(path, &error, json),
    }
}

fn read(path: &Path) -> Result<Contents, csv::Error> {
    let mut reader = csv_text::reader(BufReader::new(File::open(path)?))?;
    let columns: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
    let mut counter = Counter::new(columns.clone());
    for record in reader.records() {
        let record = record?;
        let place = |column: &str| columns.iter().position(|c| c == column);
        counter.add(|column| {
            place(column).and_then(|at| record.get(at)).unwrap_or_default().to_owned()
        });
    }
    Ok(counter.finish(path, "csv"))
}

impl Contents {
    /// Prints it.
    pub(super) fn print(&self, json: bool) -> Result<ExitCode, Failure> {
        print!("{}", if json { to_json(self)? } else { self.text() });
        Ok(ExitCode::SUCCESS)
    }

    fn text(&self) -> String {
        let format =
            if self.format == "csv" { String::new() } else { format!(" · {}", self.format) };
        let mut out = format!(
            "{}\n  {}{format} · {} · {}\n\n  columns    {}\n",
            self.path,
            self.kind,
            plural(self.rows, "row"),
            plural(self.columns.len(), "column"),
            self.columns.join(", ")
        );
        for (column, values) in &self.counts {
            let mut values: Vec<(&String, &usize)> = values.iter().collect();
            values.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
            let told = values.iter().map(|(value, n)| {
                let value = if value.is_empty() { "(none)" } else { value };
                format!("{value} {n}")
            });
            out.push_str(&format!("  {column:9}  {}\n", told.collect::<Vec<_>>().join(", ")));
        }
        if let Some(accuracy) = self.accuracy {
            out.push_str(&format!("\n  accuracy   {:.2} %\n", 100.0 * accuracy));
        }
        out
    }
}
