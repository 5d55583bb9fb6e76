//! Lists of recordings: CSV (`.csv`) or JSON lines (`.jsonl`, `.ndjson`).
//!
//! Columns (CSV header) or keys (JSON) are `path` (required), `id`, `start` and `end` in seconds; any
//! other one is a label that travels to the output. Relative paths are relative to the manifest.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, Visitor};
use serde_json::Value;

use crate::inputs::InputError;

/// File name extensions of manifests, lower case.
pub const EXTENSIONS: [&str; 3] = ["csv", "jsonl", "ndjson"];

const PATH: &str = "path";
const ID: &str = "id";
const START: &str = "start";
const END: &str = "end";

/// One row of a manifest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    pub line: u64,
    /// The path as written, for ids.
    pub written: String,
    /// The path resolved against the manifest's folder.
    pub path: PathBuf,
    pub id: Option<String>,
    pub start: Option<f64>,
    pub end: Option<f64>,
    pub labels: Vec<(String, String)>,
}

/// Reads a manifest. Every row has every label column, in the order in which the columns first
/// appear; a value that a JSON row lacks is empty.
pub(crate) fn read(path: &Path) -> Result<Vec<Entry>, InputError> {
    let is_csv = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    let rows = if is_csv { csv_rows(path)? } else { json_rows(path)? };
    let mut columns: Vec<String> = Vec::new();
    let mut known = std::collections::HashSet::new();
    for (_, cells) in &rows {
        for (name, _) in cells {
            if ![PATH, ID, START, END].contains(&name.as_str()) && known.insert(name.clone()) {
                columns.push(name.clone());
            }
        }
    }
    rows.into_iter().map(|(line, cells)| entry(path, line, cells, &columns)).collect()
}

type Row = (u64, Vec<(String, String)>);

fn wrong(path: &Path, line: u64, reason: impl Into<String>) -> InputError {
    InputError::Manifest { path: path.into(), line, reason: reason.into() }
}

fn open(path: &Path) -> Result<BufReader<File>, InputError> {
    let file = File::open(path).map_err(|e| InputError::io(path, e))?;
    let mut reader = BufReader::new(file);
    // Spreadsheets put a byte order mark in front of UTF-8.
    if reader.fill_buf().map_err(|e| InputError::io(path, e))?.starts_with(b"\xef\xbb\xbf") {
        reader.consume(3);
    }
    Ok(reader)
}

fn csv_rows(path: &Path) -> Result<Vec<Row>, InputError> {
    let csv_error = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        wrong(path, line, error.to_string())
    };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(open(path)?);
    let columns: Vec<String> =
        reader.headers().map_err(csv_error)?.iter().map(str::to_owned).collect();
    if !columns.iter().any(|name| name == PATH) {
        let reason = format!("the first line names no column `path`: {}", columns.join(", "));
        return Err(wrong(path, 1, reason));
    }
    for (index, name) in columns.iter().enumerate() {
        if name.is_empty() || columns[..index].contains(name) {
            return Err(wrong(
                path,
                1,
                format!("column {} ({name:?}) has no name of its own", index + 1),
            ));
        }
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(csv_error)?;
        let line = record.position().map_or(0, csv::Position::line);
        let cells = columns.iter().cloned().zip(record.iter().map(str::to_owned));
        rows.push((line, cells.collect()));
    }
    Ok(rows)
}

fn json_rows(path: &Path) -> Result<Vec<Row>, InputError> {
    let mut rows = Vec::new();
    for (line, text) in (1..).zip(open(path)?.lines()) {
        let text = text.map_err(|e| wrong(path, line, e.to_string()))?;
        if text.trim().is_empty() {
            continue;
        }
        let Object(fields) =
            serde_json::from_str(&text).map_err(|e| wrong(path, line, e.to_string()))?;
        let mut cells = Vec::new();
        for (name, value) in fields {
            let value = match value {
                Value::Null => String::new(),
                Value::String(text) => text,
                Value::Bool(_) | Value::Number(_) => value.to_string(),
                Value::Array(_) | Value::Object(_) => {
                    let reason = format!("{name:?} must be a string, a number or a boolean");
                    return Err(wrong(path, line, reason));
                }
            };
            cells.push((name, value));
        }
        rows.push((line, cells));
    }
    Ok(rows)
}

fn entry(
    manifest: &Path,
    line: u64,
    mut cells: Vec<(String, String)>,
    columns: &[String],
) -> Result<Entry, InputError> {
    let mut take = |name: &str| {
        let index = cells.iter().position(|(column, _)| column == name)?;
        Some(cells.swap_remove(index).1)
    };
    let labels = columns.iter().map(|c| (c.clone(), take(c).unwrap_or_default())).collect();
    let seconds = |name: &str, text: Option<String>| match text.filter(|t| !t.is_empty()) {
        None => Ok(None),
        Some(text) => match text.parse::<f64>() {
            Ok(value) if value.is_finite() && value >= 0.0 => Ok(Some(value)),
            _ => Err(wrong(manifest, line, format!("{name} = {text:?} is not a time in seconds"))),
        },
    };
    let start = seconds(START, take(START))?;
    let end = seconds(END, take(END))?;
    if let Some(end) = end.filter(|&end| end <= start.unwrap_or(0.0)) {
        let reason = format!("end = {end} is not behind start = {}", start.unwrap_or(0.0));
        return Err(wrong(manifest, line, reason));
    }
    let id = take(ID).filter(|id| !id.is_empty());
    let written = take(PATH).filter(|path| !path.is_empty());
    let written = written.ok_or_else(|| wrong(manifest, line, "no path"))?;
    let path = manifest.parent().unwrap_or(Path::new("")).join(&written);
    Ok(Entry { line, written, path, id, start, end, labels })
}

/// A JSON object with its keys in the order written, each once.
struct Object(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields;
        impl<'de> Visitor<'de> for Fields {
            type Value = Object;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a JSON object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Object, A::Error> {
                let mut fields: Vec<(String, Value)> = Vec::new();
                while let Some((name, value)) = map.next_entry::<String, Value>()? {
                    if name.is_empty() || fields.iter().any(|(other, _)| *other == name) {
                        return Err(A::Error::custom(format!(
                            "key {name:?} has no name of its own"
                        )));
                    }
                    fields.push((name, value));
                }
                Ok(Object(fields))
            }
        }
        deserializer.deserialize_map(Fields)
    }
}
