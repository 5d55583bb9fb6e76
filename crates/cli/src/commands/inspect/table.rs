//! Inspection of tables of text: predictions, submissions, capacities, detections, labels.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::ExitCode;

use corsmal_files::csv_text::{self, Fault};
use corsmal_models::predictions::PredictionTable;
use corsmal_models::scores::{ScoreReport, Scoring};
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

/// Different values of a column that are counted at most.
const MAX_VALUES: usize = 1000;
/// Values shown as text; JSON has all that were counted.
const SHOWN: usize = 20;

/// Rows of each value of a column; `None` where there are more than [`MAX_VALUES`].
type Counts = Option<BTreeMap<String, usize>>;

/// What is shown of a table.
#[derive(Serialize)]
pub(super) struct Contents {
    path: String,
    format: &'static str,
    kind: &'static str,
    rows: usize,
    columns: Vec<String>,
    counts: BTreeMap<String, Counts>,
    /// Share of right predictions as `score` counts it, where each row has its true class.
    accuracy: Option<f64>,
    /// Why there is none, where there are true classes.
    #[serde(skip_serializing_if = "Option::is_none")]
    not_scored: Option<String>,
}

/// Predictions with true classes, or why they cannot be scored.
pub(super) type Scored = Result<PredictionTable, String>;

/// Counts the rows of a table as they come.
pub(super) struct Counter {
    columns: Vec<String>,
    counts: BTreeMap<String, Counts>,
    rows: usize,
}

impl Counter {
    /// For a table with these columns.
    pub(super) fn new(columns: Vec<String>) -> Self {
        let has = |names: &[&str]| names.iter().all(|name| columns.iter().any(|c| c == name));
        let counted = COUNTED.iter().filter(|(of, _)| has(of)).flat_map(|(_, counted)| *counted);
        let counts = counted.filter(|name| has(&[name]));
        let counts = counts.map(|name| ((*name).to_owned(), Some(BTreeMap::new()))).collect();
        Self { columns, counts, rows: 0 }
    }

    /// Whether there are predictions with true classes.
    pub(super) fn has_truth(&self) -> bool {
        self.counts.contains_key("true") && self.counts.contains_key("predicted")
    }

    /// Takes in a row, given its value in a column; empty where it has none.
    pub(super) fn add(&mut self, value: impl Fn(&str) -> String) {
        self.rows += 1;
        for (column, counts) in &mut self.counts {
            if let Some(values) = counts {
                *values.entry(value(column)).or_default() += 1;
                if values.len() > MAX_VALUES {
                    *counts = None;
                }
            }
        }
    }

    /// What was counted, and how good the predictions are.
    pub(super) fn finish(
        self,
        path: &Path,
        format: &'static str,
        predictions: Option<Scored>,
    ) -> Contents {
        let Self { columns, counts, rows } = self;
        let has = |names: &[&str]| names.iter().all(|name| columns.iter().any(|c| c == name));
        let kind = KINDS.iter().find(|(_, of)| has(of)).map_or("table", |(kind, _)| *kind);
        let scored = predictions.map(|table| accuracy(&table?)).transpose();
        let prefix = format!("{}: ", path.display());
        let (accuracy, not_scored) = match scored {
            Ok(accuracy) => (accuracy, None),
            Err(reason) => (None, Some(reason.strip_prefix(&prefix).unwrap_or(&reason).to_owned())),
        };
        let path = path.display().to_string();
        Contents { path, format, kind, rows, columns, counts, accuracy, not_scored }
    }
}

/// The accuracy that `score` prints, or why there is none.
fn accuracy(table: &PredictionTable) -> Result<f64, String> {
    // The interval is not shown.
    match table.score(&Scoring { draws: 0, ..Scoring::default() }) {
        Ok(ScoreReport::Classes(report)) => Ok(report.scores.accuracy),
        Ok(ScoreReport::Numbers(_)) => Err("the true values are numbers".into()),
        Err(error) => Err(error.to_string()),
    }
}

/// Prints what a table has: of predictions, how many of each class and how many are right.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    match read(path) {
        Ok(contents) => contents.print(json),
        Err(error) => corrupt(path, &error, json),
    }
}

fn read(path: &Path) -> Result<Contents, Fault> {
    let io = |error: std::io::Error| Fault { line: None, reason: error.to_string() };
    let mut reader = csv_text::reader(BufReader::new(File::open(path).map_err(io)?)).map_err(io)?;
    let header = csv_text::header(&mut reader)?;
    let columns: Vec<String> = header.iter().map(str::to_owned).collect();
    let mut counter = Counter::new(columns.clone());
    for found in csv_text::records(&mut reader) {
        let (_, record) = found?;
        let place = |column: &str| columns.iter().position(|c| c == column);
        counter.add(|column| {
            place(column).and_then(|at| record.get(at)).unwrap_or_default().to_owned()
        });
    }
    let predictions =
        counter.has_truth().then(|| PredictionTable::read(path).map_err(|e| e.to_string()));
    Ok(counter.finish(path, "csv", predictions))
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
            let Some(values) = values else {
                out.push_str(&format!("  {column:9}  more than {MAX_VALUES} different values\n"));
                continue;
            };
            let mut values: Vec<(&String, &usize)> = values.iter().collect();
            values.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
            let told = values.iter().take(SHOWN).map(|(value, n)| {
                let value = if value.is_empty() { "(none)" } else { value };
                format!("{value} {n}")
            });
            let mut told: Vec<String> = told.collect();
            if values.len() > SHOWN {
                told.push(format!("and {} more", values.len() - SHOWN));
            }
            out.push_str(&format!("  {column:9}  {}\n", told.join(", ")));
        }
        if let Some(accuracy) = self.accuracy {
            out.push_str(&format!("\n  accuracy   {:.2} %\n", 100.0 * accuracy));
        }
        if let Some(reason) = &self.not_scored {
            out.push_str(&format!("\n  accuracy   not scored: {reason}\n"));
        }
        out
    }
}
