//! Inspection of models and of tables of text, such as predictions.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::process::ExitCode;

use corsmal_files::csv_text;
use corsmal_models::model_file::{Model, ModelHeader};
use serde::Serialize;
use serde_json::Value;

use super::refusal::{Refusal, to_json};
use crate::failure::Failure;
use crate::plural::plural;

/// First bytes of a model file.
const MODEL: &[u8] = b"CORSMDL\0";

/// What a file without samples or features may be.
pub enum Kind {
    /// A trained model.
    Model,
    /// Lines of comma-separated values.
    Table,
}

/// What a file is by its first bytes, if it is one of these.
pub fn kind(path: &Path) -> std::io::Result<Option<Kind>> {
    let mut start = Vec::new();
    File::open(path)?.take(4096).read_to_end(&mut start)?;
    if start.starts_with(MODEL) {
        return Ok(Some(Kind::Model));
    }
    let head = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start);
    let line = head.split(|b| *b == b'\n').next().unwrap_or_default();
    let words = line.iter().all(|b| *b >= 0x20 || *b == b'\r' || *b == b'\t');
    let table = words && line.contains(&b',') && std::str::from_utf8(line).is_ok();
    Ok(table.then_some(Kind::Table))
}

/// Prints what a model was trained on and what it predicts.
pub fn model(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    match Model::load(path) {
        Ok(model) => {
            let header = model.header();
            print!("{}", if json { to_json(header)? } else { model_text(&name, header)? });
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => {
            let reason = error.to_string();
            Refusal { path: &name, status: "corrupt", byte: None, reason: &reason }.print(json)
        }
    }
}

fn model_text(name: &str, header: &ModelHeader) -> Result<String, Failure> {
    let document = serde_json::to_value(header)?;
    let mut out = format!(
        "{name}\n  model · corsmal-feat {} · predicts {} from {}\n",
        header.tool_version,
        header.target,
        plural(header.feature_names.len(), "feature")
    );
    let classes: Vec<&str> = match &document["labels"] {
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
        Value::Object(fields) => fields
            .values()
            .filter_map(Value::as_array)
            .flatten()
            .filter_map(Value::as_str)
            .collect(),
        _ => Vec::new(),
    };
    out.push_str(&format!("\n  classes        {}\n", classes.join(", ")));
    out.push_str(&format!("  recordings     {}\n", recordings(header)));
    for (key, value) in
        [("pipeline", &document["pipeline"]), ("trained on", &document["provenance"])]
    {
        let mut lines = Vec::new();
        flatten("", value, &mut lines);
        for (i, line) in lines.iter().enumerate() {
            out.push_str(&format!("  {:13}  {line}\n", if i == 0 { key } else { "" }));
        }
    }
    if !header.feature_config_hash.is_empty() {
        out.push_str(&format!("  configuration  {}\n", header.feature_config_hash));
    }
    out.push_str(&format!("\n  corsmal-feat classify --model {name} RECORDINGS\n"));
    Ok(out)
}

/// The recordings that the model was trained on: what `classify` refuses others by.
fn recordings(header: &ModelHeader) -> String {
    let Some(trained) = &header.trained_on else {
        return "sample rates and channels not recorded: classify needs --any-rate".into();
    };
    let listed = |values: &[u32]| values.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let ending = if trained.channels == [1] { "" } else { "s" };
    format!("{} Hz, {} channel{ending}", listed(&trained.sample_rates), listed(&trained.channels))
}

/// One line `key = value` for every value.
fn flatten(key: &str, value: &Value, lines: &mut Vec<String>) {
    match value {
        Value::Object(table) => {
            for (name, value) in table {
                let dot = if key.is_empty() { "" } else { "." };
                flatten(&format!("{key}{dot}{name}"), value, lines);
            }
        }
        Value::Null => {}
        value => lines.push(format!("{key} = {value}")),
    }
}

/// What is shown of a table.
#[derive(Serialize)]
struct Contents {
    path: String,
    format: &'static str,
    rows: usize,
    columns: Vec<String>,
    /// Rows of each value of the columns that have few.
    counts: BTreeMap<String, BTreeMap<String, usize>>,
    /// Share of right predictions, where the table has true classes.
    accuracy: Option<f64>,
}

/// Columns whose values are counted.
const COUNTED: [&str; 4] = ["status", "predicted", "true", "fold"];

/// Prints what a table has: of predictions, how many of each class and how many are right.
pub fn table(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    match read(path, &name) {
        Ok(contents) => {
            print!("{}", if json { to_json(&contents)? } else { contents.text() });
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => {
            let reason = error.to_string();
            Refusal { path: &name, status: "corrupt", byte: None, reason: &reason }.print(json)
        }
    }
}

fn read(path: &Path, name: &str) -> Result<Contents, csv::Error> {
    let mut reader = csv_text::reader(BufReader::new(File::open(path)?))?;
    let columns: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
    let place = |wanted: &str| columns.iter().position(|c| c == wanted);
    let counted: Vec<(&str, usize)> =
        COUNTED.iter().filter_map(|c| Some((*c, place(c)?))).collect();
    let truth = place("true").zip(place("predicted"));
    let mut counts: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    let (mut rows, mut scored, mut right) = (0, 0usize, 0usize);
    for record in reader.records() {
        let record = record?;
        rows += 1;
        for (column, at) in &counted {
            let values = counts.entry((*column).to_owned()).or_default();
            *values.entry(record.get(*at).unwrap_or_default().to_owned()).or_default() += 1;
        }
        if let Some((truth, predicted)) = truth
            && let (Some(truth), Some(predicted)) = (record.get(truth), record.get(predicted))
            && !truth.is_empty()
        {
            scored += 1;
            right += usize::from(truth == predicted);
        }
    }
    let accuracy = (scored > 0).then(|| right as f64 / scored as f64);
    Ok(Contents { path: name.to_owned(), format: "csv", rows, columns, counts, accuracy })
}

impl Contents {
    fn text(&self) -> String {
        let mut out = format!(
            "{}\n  table · {} · {}\n\n  columns    {}\n",
            self.path,
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
