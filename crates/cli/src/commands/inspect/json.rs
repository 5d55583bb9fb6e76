//! Inspection of JSON: capacity models, calibrations, detections, reports, predictions line by line.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::ExitCode;

use corsmal_ccm::capacity::CapacityModel;
use corsmal_files::csv_text;
use corsmal_models::predictions::PredictionTable;
use corsmal_vision::read_detections;
use serde::Serialize;
use serde_json::Value;

use super::calibration;
use super::model::flatten;
use super::refusal::{corrupt, to_json};
use super::table::{Counter, Scored};
use crate::failure::Failure;

/// Largest value, and longest line, that is read.
const MAX_BYTES: u64 = 64 << 20;
/// Mark of UTF-8 that some programs put before a text.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// What is shown of a file.
#[derive(Serialize)]
struct Contents {
    path: String,
    format: &'static str,
    kind: &'static str,
    #[serde(flatten)]
    facts: Value,
    #[serde(skip)]
    lines: Vec<String>,
}

/// Prints what a file of JSON holds.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let refused = |reason: String| corrupt(path, &reason, json);
    let value = match read(path) {
        Ok(value) => value,
        Err(reason) => return refused(reason),
    };
    let value = value.filter(|value| !is_record(path, value));
    let Some(value) = value else {
        return match records(path) {
            Ok((counter, table)) => counter.finish(path, "jsonl", table).print(json),
            Err(reason) => refused(reason),
        };
    };
    let has = |keys: &[&str]| {
        let value = if value.is_array() { &value[0] } else { &value };
        keys.iter().all(|key| value.get(key).is_some())
    };
    if value["intrinsic"].is_object() || has(&["rgb"]) {
        return calibration::inspect(path, json);
    }
    let found = if value["kind"].as_str().is_some_and(|kind| kind == "corsmal-feat capacity model")
    {
        model(path, &value)
    } else if value.as_array().is_some_and(Vec::is_empty)
        || value.is_array() && has(&["frame", "view", "label", "score"])
    {
        // The only lists that the tool writes; an empty one where nothing was seen.
        detections(path)
    } else {
        Ok(other(&value))
    };
    match found {
        Ok((kind, facts, lines)) => {
            let contents =
                Contents { path: path.display().to_string(), format: "json", kind, facts, lines };
            print!("{}", if json { to_json(&contents)? } else { contents.text() });
            Ok(ExitCode::SUCCESS)
        }
        Err(reason) => refused(reason),
    }
}

/// Whether the only value of a file is the only line of one that has a record a line.
fn is_record(path: &Path, value: &Value) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    let lines = matches!(ending.as_deref(), Some("jsonl" | "ndjson"));
    let prediction = ["id", "status", "predicted"].iter().all(|key| value.get(key).is_some());
    value.is_object() && (lines || prediction)
}

/// The only value of a file; `None` where there is one a line.
fn read(path: &Path) -> Result<Option<Value>, String> {
    let mut reader = BufReader::new(File::open(path).map_err(|e| e.to_string())?);
    let mut first = Vec::new();
    Read::take(&mut reader, MAX_BYTES).read_until(b'\n', &mut first).map_err(|e| e.to_string())?;
    let whole: Option<Value> = serde_json::from_slice(unmarked(&first)).ok();
    let more =
        reader.fill_buf().map_err(|e| e.to_string())?.iter().any(|b| !b.is_ascii_whitespace());
    if whole.is_some() {
        return Ok(whole.filter(|_| !more));
    }
    Read::take(&mut reader, MAX_BYTES + 1 - (first.len() as u64).min(MAX_BYTES))
        .read_to_end(&mut first)
        .map_err(|e| e.to_string())?;
    if first.len() as u64 > MAX_BYTES {
        return Err(format!("a JSON value of more than {} MiB", MAX_BYTES >> 20));
    }
    let found = serde_json::from_slice(unmarked(&first));
    found.map(Some).map_err(|e| format!("not readable as JSON: {e}"))
}

fn unmarked(text: &[u8]) -> &[u8] {
    text.strip_prefix(MARK).unwrap_or(text)
}

/// Objects line by line, counted, and as the table that `score` would read of them.
fn records(path: &Path) -> Result<(Counter, Option<Scored>), String> {
    let mut reader = BufReader::new(File::open(path).map_err(|e| e.to_string())?);
    let mut table: Option<(Vec<String>, Counter)> = None;
    // Counting takes no memory, scoring does.
    let scored = std::fs::metadata(path).is_ok_and(|file| file.len() <= MAX_BYTES);
    let mut csv = Vec::new();
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        let read = Read::take(&mut reader, MAX_BYTES).read_until(b'\n', &mut line);
        if read.map_err(|e| e.to_string())? == 0 {
            break;
        }
        let text = if number == 1 { unmarked(&line) } else { &line };
        if text.trim_ascii().is_empty() {
            continue;
        }
        let value: Value = serde_json::from_slice(text).map_err(|e| of_line(number, &e))?;
        let Value::Object(record) = value else {
            return Err(format!("line {number} is not an object"));
        };
        let cell = |column: &str| match record.get(column) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
        };
        if table.is_none() {
            let columns: Vec<String> = record.keys().cloned().collect();
            let counter = Counter::new(columns.clone());
            if scored && counter.has_truth() {
                csv.extend(csv_text::line(&columns));
            }
            table = Some((columns, counter));
        }
        if let Some((columns, counter)) = &mut table {
            counter.add(cell);
            if scored && counter.has_truth() {
                let cells: Vec<String> = columns.iter().map(|column| cell(column)).collect();
                csv.extend(csv_text::line(&cells));
            }
        }
    }
    let (_, counter) = table.ok_or("no line")?;
    let table = counter.has_truth().then(|| match scored {
        true => PredictionTable::parse(&csv, path).map_err(|e| e.to_string()),
        false => Err(format!("more than {} MiB", MAX_BYTES >> 20)),
    });
    Ok((counter, table))
}

/// What is wrong with the JSON of a line, which serde_json takes for the first.
fn of_line(number: usize, error: &serde_json::Error) -> String {
    let place = format!(" at line {} column {}", error.line(), error.column());
    let text = error.to_string();
    let what = text.strip_suffix(&place).unwrap_or(&text);
    format!("line {number}, column {}: {what}", error.column())
}

/// Kind, facts and lines of text.
type Found = (&'static str, Value, Vec<String>);

fn line(label: &str, text: impl std::fmt::Display) -> String {
    format!("  {label:13}  {text}")
}

fn model(path: &Path, value: &Value) -> Result<Found, String> {
    CapacityModel::read(path).map_err(|e| e.to_string())?;
    let keys = |value: &Value| -> Vec<String> {
        value.as_object().into_iter().flatten().map(|(key, _)| key.clone()).collect()
    };
    let categories = keys(&value["m3"]["processes"]);
    let fused = value["fusion"].is_object();
    let learned = if fused { "m3 and the fused estimate" } else { "m3" };
    let mut lines = vec![
        line("for", learned),
        line("categories", categories.join(", ")),
        line(
            "made by",
            format!("corsmal-feat {}", value["tool_version"].as_str().unwrap_or_default()),
        ),
    ];
    let mut provenance = Vec::new();
    flatten("", &value["provenance"], &mut provenance);
    lines.extend(
        provenance
            .iter()
            .enumerate()
            .map(|(i, text)| line(if i == 0 { "learned from" } else { "" }, text)),
    );
    let method = if fused { "fused" } else { "m3" };
    lines.push(String::new());
    lines.push(format!("  corsmal-feat capacity --method {method} --model {}", path.display()));
    let facts = serde_json::json!({
        "fused": fused, "categories": categories, "tool_version": value["tool_version"],
        "provenance": value["provenance"],
    });
    Ok(("capacity model", facts, lines))
}

fn detections(path: &Path) -> Result<Found, String> {
    let all = read_detections(path).map_err(|e| e.to_string())?;
    let (mut labels, mut views): (BTreeMap<&str, usize>, BTreeMap<u8, usize>) = Default::default();
    for detection in &all {
        *labels.entry(&detection.label).or_default() += 1;
        *views.entry(detection.view).or_default() += 1;
    }
    let frames: std::collections::BTreeSet<u32> = all.iter().map(|d| d.frame).collect();
    let listed = |counts: Vec<String>| counts.join(", ");
    let lines = vec![
        line("detections", all.len()),
        line("frames", frames.len()),
        line("views", listed(views.iter().map(|(view, n)| format!("{view} × {n}")).collect())),
        line("labels", listed(labels.iter().map(|(label, n)| format!("{label} × {n}")).collect())),
    ];
    let facts = serde_json::json!({
        "detections": all.len(), "frames": frames.len(), "views": views, "labels": labels,
    });
    Ok(("table of detections", facts, lines))
}

/// Anything else: its keys, or how many values it has.
fn other(value: &Value) -> Found {
    match value {
        Value::Object(fields) => {
            let keys: Vec<&String> = fields.keys().collect();
            // A report of `benchmark` or a study.
            let report = fields.contains_key("sections") && fields.contains_key("title");
            let mut lines = Vec::new();
            if report {
                lines.push(line("title", value["title"].as_str().unwrap_or_default()));
                let sections = value["sections"].as_array().into_iter().flatten();
                let titles: Vec<&str> = sections.filter_map(|s| s["title"].as_str()).collect();
                lines.push(line("sections", titles.join(", ")));
            }
            let names: Vec<&str> = keys.iter().map(|key| key.as_str()).collect();
            lines.push(line("keys", names.join(", ")));
            let kind = if report { "report" } else { "object" };
            (kind, serde_json::json!({ "keys": keys }), lines)
        }
        Value::Array(values) => {
            let facts = serde_json::json!({ "values": values.len() });
            ("list", facts, vec![line("values", values.len())])
        }
        value => ("value", serde_json::json!({ "value": value }), vec![line("value", value)]),
    }
}

impl Contents {
    fn text(&self) -> String {
        format!("{}\n  {} · {}\n\n{}\n", self.path, self.kind, self.format, self.lines.join("\n"))
    }
}
