//! Lists of recordings: CSV (`.csv`) or JSON lines (`.jsonl`, `.ndjson`).
//!
//! Columns (CSV header) or keys (JSON) are `path` (required), `id`, `start` and `end` in seconds; any
//! other one is a label that travels to the output. Columns of CSV without a name, which pandas writes
//! for its index, are ignored. Relative paths are relative to the manifest.
//!
//! Time and memory grow with the size of the file, within [`MAX_LINE`], [`MAX_COLUMNS`] and
//! [`MAX_CELLS`](crate::inputs::cells::MAX_CELLS).

use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use corsmal_files::csv_text::{self, Fault, LineFeeds};
use corsmal_files::quote::{printable, quoted, shown};
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, Visitor};
use serde_json::Value;

use crate::inputs::cells::require_cells;
use crate::inputs::error::InputError;
use crate::inputs::times::{END, Given, Role, START, is_number, refusal_of};

/// File name extensions of manifests, lower case.
pub const EXTENSIONS: [&str; 3] = ["csv", "jsonl", "ndjson"];

/// Longest line in bytes (1 MiB).
pub const MAX_LINE: usize = 1 << 20;
/// Most columns of a CSV, and most different keys of JSON lines.
pub const MAX_COLUMNS: usize = 4096;

const PATH: &str = "path";
pub(crate) const ID: &str = "id";

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
    if is_csv { csv_rows(path) } else { json_rows(path) }
}

fn wrong(path: &Path, line: u64, reason: impl AsRef<str>) -> InputError {
    InputError::Manifest { path: path.into(), line, reason: printable(reason.as_ref()) }
}

/// Passes bytes through, up to a line that is too long.
struct Short<R> {
    inner: R,
    line: u64,
    length: usize,
}

impl<R: Read> Read for Short<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(out)?;
        for part in out[..read].split_inclusive(|byte| *byte == b'\n') {
            self.length += part.len();
            if self.length > MAX_LINE {
                let reason = format!("longer than {MAX_LINE} bytes");
                return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
            }
            if part.last() == Some(&b'\n') {
                (self.line, self.length) = (self.line + 1, 0);
            }
        }
        Ok(read)
    }
}

fn open(path: &Path) -> Result<BufReader<Short<File>>, InputError> {
    let inner = File::open(path).map_err(|e| InputError::io(path, e))?;
    Ok(BufReader::new(Short { inner, line: 1, length: 0 }))
}

/// The columns of a manifest: which are labels, in order, and where the others are.
#[derive(Default)]
struct ManifestColumns {
    places: HashMap<String, usize>,
    labels: Vec<(usize, String)>,
    /// Which of the labels are called like times.
    times: Vec<(usize, Role)>,
    /// Bytes of the names of labels.
    bytes: usize,
}

impl ManifestColumns {
    /// Takes note of a column, unless it is there already.
    fn place(&mut self, name: &str) -> Result<usize, String> {
        if let Some(place) = self.places.get(name) {
            return Ok(*place);
        }
        let place = self.places.len();
        if place == MAX_COLUMNS {
            return Err(format!("more than {MAX_COLUMNS} different columns"));
        }
        // As a label it would be passed on unread, and the whole recording computed.
        let meant = [ID, START, END].into_iter().find(|own| name.eq_ignore_ascii_case(own));
        if let Some(own) = meant.filter(|own| *own != name) {
            let name = quoted(name);
            return Err(format!(
                "column {name} must be called `{own}`; a label must be called otherwise"
            ));
        }
        self.places.insert(name.into(), place);
        if ![PATH, ID, START, END].contains(&name) {
            self.times.extend(Role::of(name).map(|role| (self.labels.len(), role)));
            self.labels.push((place, name.into()));
            self.bytes += name.len();
        }
        Ok(place)
    }

    /// Why a row has other times than are read.
    fn misread(&self, row: &Entry) -> Option<String> {
        if self.times.is_empty() {
            return None;
        }
        let times = self.times.iter().map(|(at, role)| (&row.labels[*at], *role));
        let numbers = times.filter(|((_, value), _)| is_number(value));
        let others: Vec<_> = numbers.map(|((name, _), role)| (name.as_str(), role)).collect();
        let (start, end) = (row.start.is_some(), row.end.is_some());
        let any_column = [START, END].into_iter().any(|own| self.places.contains_key(own));
        refusal_of(Given { any_column, start, end }, &others)
    }

    /// Refuses more than so many rows should hold.
    fn require(&self, rows: usize) -> Result<(), String> {
        require_cells(rows, self.labels.len(), self.bytes)
    }

    fn entry(
        &self,
        manifest: &Path,
        line: u64,
        mut take: impl FnMut(usize) -> String,
    ) -> Result<Entry, InputError> {
        let labels = self.labels.iter().map(|(i, name)| (name.clone(), take(*i))).collect();
        let mut given = |name: &str| {
            let value = self.places.get(name).map(|place| take(*place));
            value.filter(|value| !value.is_empty())
        };
        let seconds = |name: &str, text: Option<String>| match text {
            None => Ok(None),
            Some(text) => match text.trim().parse::<f64>() {
                Ok(value) if value.is_finite() && value >= 0.0 => Ok(Some(value)),
                _ => {
                    let reason = format!("{name} = {} is not a time in seconds", quoted(&text));
                    Err(wrong(manifest, line, reason))
                }
            },
        };
        let start = seconds(START, given(START))?;
        let end = seconds(END, given(END))?;
        if let Some(end) = end.filter(|&end| end <= start.unwrap_or(0.0)) {
            let reason = format!("end = {end} is not after start = {}", start.unwrap_or(0.0));
            return Err(wrong(manifest, line, reason));
        }
        let id = given(ID);
        let written = given(PATH).ok_or_else(|| wrong(manifest, line, "no path"))?;
        let path = manifest.parent().unwrap_or(Path::new("")).join(&written);
        let entry = Entry { line, written, path, id, start, end, labels };
        match self.misread(&entry) {
            Some(reason) => Err(wrong(manifest, line, reason)),
            None => Ok(entry),
        }
    }
}

fn csv_rows(path: &Path) -> Result<Vec<Entry>, InputError> {
    let failed = |fault: Fault, reader: &csv::Reader<LineFeeds<BufReader<Short<File>>>>| {
        // The reader is ahead of the position, but a line that is too long stops it.
        let line = fault.line.unwrap_or_else(|| reader.get_ref().get_ref().get_ref().line);
        wrong(path, line, fault.reason)
    };
    let mut reader = csv_text::reader(open(path)?).map_err(|e| InputError::io(path, e))?;
    let mut columns = ManifestColumns::default();
    let names = csv_text::header(&mut reader).map_err(|fault| failed(fault, &reader))?;
    // Where in a record each column is.
    let mut cells = Vec::new();
    for (index, name) in names.iter().enumerate().filter(|(_, name)| !is_index(name)) {
        let place = columns.place(name).map_err(|reason| wrong(path, 1, reason))?;
        if place != cells.len() {
            let reason = format!(
                "column {} ({}) must have a name that no other column has",
                index + 1,
                quoted(name)
            );
            return Err(wrong(path, 1, reason));
        }
        cells.push(index);
    }
    if !columns.places.contains_key(PATH) {
        let names: Vec<&str> = columns.labels.iter().map(|(_, name)| name.as_str()).collect();
        let likely = names.iter().find(|name| corsmal_names::names_files(name));
        let remedy = likely.map(|name| format!("; if {name} names the recordings, call it `path`"));
        let names = shown(&names.join(", "));
        let reason = format!("the first line names no column `path`: {names}");
        return Err(wrong(path, 1, reason + &remedy.unwrap_or_default()));
    }
    let mut rows = Vec::new();
    loop {
        let found = csv_text::records(&mut reader).next();
        let Some(found) = found else { return Ok(rows) };
        let (line, record) = found.map_err(|fault| failed(fault, &reader))?;
        let cell = |place: usize| record.get(cells[place]).unwrap_or_default().to_owned();
        rows.push(columns.entry(path, line, cell)?);
        columns.require(rows.len()).map_err(|e| wrong(path, line, e))?;
    }
}

/// Whether pandas wrote the column for its index, or read such a column and wrote it again.
fn is_index(name: &str) -> bool {
    name.is_empty() || name.strip_prefix("Unnamed: ").is_some_and(|n| n.parse::<u32>().is_ok())
}

fn json_rows(path: &Path) -> Result<Vec<Entry>, InputError> {
    let mut columns = ManifestColumns::default();
    let mut rows = Vec::new();
    for (line, text) in (1..).zip(open(path)?.lines()) {
        let text = text.map_err(|e| wrong(path, line, e.to_string()))?;
        let text = text.trim_start_matches('\u{feff}'); // a byte order mark
        if text.trim().is_empty() {
            continue;
        }
        let fields = fields(text).map_err(|reason| wrong(path, line, reason))?;
        let mut cells = Vec::with_capacity(fields.len());
        for (name, value) in fields {
            let value = match label(value) {
                Ok(Some(value)) => value,
                Ok(None) => {
                    let name = quoted(&name);
                    let reason = format!("{name} must be a string, a number or a boolean");
                    return Err(wrong(path, line, reason));
                }
                Err(rounded) => {
                    let reason = format!("{}: {rounded}", quoted(&name));
                    return Err(wrong(path, line, reason));
                }
            };
            let place = columns.place(&name).map_err(|reason| wrong(path, line, reason))?;
            cells.push((place, value));
        }
        rows.push((line, cells));
        columns.require(rows.len()).map_err(|e| wrong(path, line, e))?;
    }
    let mut values = vec![String::new(); columns.places.len()];
    let entries = rows.into_iter().map(|(line, cells)| {
        values.iter_mut().for_each(String::clear);
        cells.into_iter().for_each(|(place, value)| values[place] = value);
        columns.entry(path, line, |place| std::mem::take(&mut values[place]))
    });
    entries.collect()
}

/// The keys and values of a JSON object, in the order written; no key is empty or there twice.
pub(crate) fn fields(text: &str) -> Result<Vec<(String, Value)>, String> {
    let object: Object = serde_json::from_str(text).map_err(|e| json_fault(&e))?;
    Ok(object.0)
}

/// What is wrong with a line of JSON; the number of the line is told beside it.
fn json_fault(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    match text.strip_suffix(&place) {
        Some(what) => format!("{what} (column {})", error.column()),
        None => text,
    }
}

/// The text of a value that can be a label; none of lists and objects.
///
/// # Errors
/// A whole number that was rounded when it was read: two of them could become one label.
pub(crate) fn label(value: Value) -> Result<Option<String>, String> {
    const EXACT: f64 = (1_u64 << f64::MANTISSA_DIGITS) as f64;
    Ok(match value {
        Value::Null => Some(String::new()),
        Value::String(text) => Some(text),
        Value::Number(number)
            if number.is_f64() && number.as_f64().is_none_or(|x| x.abs() >= EXACT) =>
        {
            return Err(format!(
                "{number} must be a string: a number of so many digits is rounded"
            ));
        }
        Value::Bool(_) | Value::Number(_) => Some(value.to_string()),
        Value::Array(_) | Value::Object(_) => None,
    })
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
                let mut names = HashSet::new();
                while let Some((name, value)) = map.next_entry::<String, Value>()? {
                    if name.is_empty() || !names.insert(name.clone()) {
                        let name = quoted(&name);
                        return Err(A::Error::custom(format!(
                            "key {name} is empty or given twice"
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

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(name: &str, text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        read(&path).unwrap_err().to_string()
    }

    /// Whole recordings were computed, and their times passed on as labels.
    #[test]
    fn times_under_other_names_are_refused() {
        for (name, own) in [("Start", "start"), ("END", "end"), ("Id", "id")] {
            let text = refusal("list.csv", &format!("path,{name}\na.wav,1\n"));
            assert!(text.contains(&format!("must be called `{own}`")), "{text}");
            let text = refusal("list.jsonl", &format!("{{\"path\": \"a.wav\", \"{name}\": 1}}\n"));
            assert!(text.contains(&format!("must be called `{own}`")), "{text}");
        }
        let text = refusal("list.csv", "path,onset,offset,event\na.wav,1,2,dog\n");
        assert!(text.contains("are read from columns `start` and `end`"), "{text}");
        let text = refusal("list.csv", "path,onset,duration\na.wav,1,2\n");
        assert!(text.contains("are read from columns `start` and `end`"), "{text}");
        let text = refusal("list.jsonl", "{\"path\": \"a.wav\", \"Onset\": 1, \"Offset\": 2}\n");
        assert!(text.contains("are read from columns `start` and `end`"), "{text}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.csv");
        std::fs::write(&path, "path,onset,offset,start,end\na.wav,1,2,1,2\n").unwrap();
        assert_eq!(read(&path).unwrap()[0].start, Some(1.0));
        // Empty cells are none, and labels that are no numbers are no times.
        let text = refusal("list.csv", "path,start,end,duration\na.wav,1,2,1\na.wav,2,,1\n");
        assert!(text.contains(", line 3:") && text.contains("\"duration\" is a label"), "{text}");
        std::fs::write(&path, "path,start,length\na.wav,1,12cm\n").unwrap();
        assert_eq!(read(&path).unwrap()[0].labels[0].1, "12cm");
    }

    /// Two numbers became one label.
    #[test]
    fn whole_numbers_of_more_than_64_bits_are_refused() {
        let row = |n: &str| format!("{{\"path\": \"a.wav\", \"serial\": {n}}}\n");
        for n in ["12345678901234567890123", "-9223372036854775809", "1e300"] {
            let text = refusal("list.jsonl", &row(n));
            assert!(text.contains("must be a string"), "{text}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.jsonl");
        std::fs::write(&path, row("18446744073709551615") + &row("0.5")).unwrap();
        let labels: Vec<String> =
            read(&path).unwrap().into_iter().map(|entry| entry.labels[0].1.clone()).collect();
        assert_eq!(labels, ["18446744073709551615", "0.5"]);
    }
}
