//! Predictions as lines of CSV or JSON, on standard output or into a file.

use std::io::Write;
use std::path::Path;

use clap::ValueEnum;
use corsmal_files::outcome::Status;
use corsmal_models::labels::Labels;
use serde_json::{Map, Value, json};

use corsmal_files::draft::Draft;

use crate::failure::Failure;

/// How lines are written.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Form {
    /// A header, then a line each.
    Csv,
    /// A JSON object a line.
    Jsonl,
}

/// What a line is about.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// A recording.
    Recording,
    /// A window of one, with start and end in seconds.
    Window,
    /// A recording whose windows, so many, were made one decision.
    Vote,
}

/// One prediction, or why there is none.
pub struct Line<'a> {
    /// Of the recording.
    pub id: &'a str,
    /// Where it was read from; empty where unknown.
    pub path: &'a str,
    /// Start and end of a window.
    pub span: Option<(f64, f64)>,
    /// Number of windows.
    pub windows: usize,
    /// As in the outcomes of `extract`.
    pub status: Status,
    /// The class.
    pub class: Option<usize>,
    /// Of every class.
    pub proba: Option<Vec<f64>>,
}

/// Where lines go.
pub enum Target {
    /// Standard output, line by line.
    Stdout(std::io::Stdout),
    /// A file that appears when it is whole.
    File(Draft),
}

impl Target {
    /// `-` is standard output.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        if path == Path::new("-") {
            Ok(Self::Stdout(std::io::stdout()))
        } else {
            Ok(Self::File(Draft::create(path)?))
        }
    }
}

/// Writes lines of one unit and form.
pub struct PredictionLines<'a> {
    target: Target,
    form: Form,
    unit: Unit,
    labels: &'a Labels,
    begun: bool,
    /// Lines written.
    pub written: usize,
    /// Lines without a prediction, or with one from a part of the windows only.
    pub failed: usize,
}

impl<'a> PredictionLines<'a> {
    /// Nothing is written before the first line, so that a refusal leaves nothing behind.
    pub fn new(target: Target, form: Form, unit: Unit, labels: &'a Labels) -> Self {
        Self { target, form, unit, labels, begun: false, written: 0, failed: 0 }
    }

    /// Writes a line and hands it on at once.
    pub fn write(&mut self, line: &Line<'_>) -> std::io::Result<()> {
        self.begin()?;
        self.written += 1;
        self.failed += usize::from(line.class.is_none() || !line.status.has_features());
        match self.form {
            Form::Csv => {
                let fields = self.fields(line);
                self.put(&csv_line(&fields)?)
            }
            Form::Jsonl => {
                let text = format!("{}\n", self.object(line));
                self.put(text.as_bytes())
            }
        }
    }

    /// Ends the output; a file gets its name.
    pub fn finish(mut self) -> Result<(), Failure> {
        self.begin()?;
        match self.target {
            Target::Stdout(_) => Ok(()),
            Target::File(draft) => Ok(draft.publish()?),
        }
    }

    fn begin(&mut self) -> std::io::Result<()> {
        if std::mem::replace(&mut self.begun, true) || self.form == Form::Jsonl {
            return Ok(());
        }
        let unit: &[&str] = match self.unit {
            Unit::Recording => &["status"],
            Unit::Window => &["start", "end", "status"],
            Unit::Vote => &["status", "windows"],
        };
        let fixed = [&["id", "path"], unit, &["predicted"]].concat();
        let classes = self.labels.names().iter().map(|label| format!("p_{label}"));
        let header: Vec<_> = fixed.into_iter().map(String::from).chain(classes).collect();
        self.put(&csv_line(&header)?)
    }

    fn fields(&self, line: &Line<'_>) -> Vec<String> {
        let second =
            |of: fn((f64, f64)) -> f64| line.span.map_or(String::new(), |s| seconds(of(s)));
        let unit = match self.unit {
            Unit::Recording => vec![line.status.name().to_string()],
            Unit::Window => vec![second(|s| s.0), second(|s| s.1), line.status.name().to_string()],
            Unit::Vote => vec![line.status.name().to_string(), line.windows.to_string()],
        };
        let predicted = line.class.map_or(String::new(), |c| self.labels.names()[c].clone());
        let classes = (0..self.labels.len()).map(|class| match &line.proba {
            Some(proba) => proba[class].to_string(),
            None => String::new(),
        });
        let names = [line.id, line.path].map(String::from);
        names.into_iter().chain(unit).chain([predicted]).chain(classes).collect()
    }

    fn object(&self, line: &Line<'_>) -> Value {
        let labels = self.labels.names();
        let mut object = json!({ "id": line.id, "path": line.path });
        if let (Unit::Window, Some((start, end))) = (self.unit, line.span) {
            object["start"] = rounded(start).into();
            object["end"] = rounded(end).into();
        }
        object["status"] = line.status.name().into();
        if self.unit == Unit::Vote {
            object["windows"] = line.windows.into();
        }
        object["predicted"] = line.class.map(|class| labels[class].as_str()).into();
        object["probabilities"] = match &line.proba {
            Some(proba) => labels
                .iter()
                .cloned()
                .zip(proba.iter().map(|&p| p.into()))
                .collect::<Map<_, _>>()
                .into(),
            None => Value::Null,
        };
        object
    }

    fn put(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        match &mut self.target {
            Target::Stdout(out) => out.write_all(bytes).and_then(|()| out.flush()),
            Target::File(draft) => draft.write_all(bytes),
        }
    }
}

/// To the nanosecond, so that a manifest with these times takes the same frames.
fn rounded(seconds: f64) -> f64 {
    (seconds * 1e9).round() / 1e9
}

fn seconds(value: f64) -> String {
    rounded(value).to_string()
}

/// One record with its line end.
pub fn csv_line<S: AsRef<[u8]>>(fields: &[S]) -> std::io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(fields)?;
    writer.into_inner().map_err(|e| e.into_error())
}
