//! The lines of `classify`.

use std::io::{self, Write};

use corsmal_files::outcome::Status;

use super::write::{Cell, Form, PredictionWriter};
use crate::labels::Labels;

/// What a line is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A recording.
    Recording,
    /// A window of one, with start and end in seconds.
    Window,
    /// A recording whose windows, so many, were made one decision.
    Vote,
}

/// One prediction, or why there is none.
#[derive(Clone, Debug)]
pub struct Record<'a> {
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
    /// Text of each label column; none where the recording has none.
    pub labels: Vec<&'a str>,
    /// The class.
    pub class: Option<usize>,
    /// Of every class.
    pub proba: Option<Vec<f64>>,
}

/// Writes records of one unit.
pub struct RecordWriter<W> {
    writer: PredictionWriter<W>,
    unit: Unit,
    label_columns: usize,
    /// least probability of a prediction that counts
    reject: f64,
    /// Lines written.
    pub written: usize,
    /// Lines without a prediction, or with one from a part of the windows only.
    pub failed: usize,
    /// Predictions that were rejected.
    pub rejected: usize,
}

impl<W: Write> RecordWriter<W> {
    /// `columns` names the label columns of the recordings; the column that the model predicts is
    /// called `true`. Predictions with a highest probability below `reject` are unknown.
    pub fn new(
        out: W,
        (form, unit): (Form, Unit),
        labels: &Labels,
        (columns, target): (&[String], &str),
        reject: f64,
    ) -> Self {
        let by_unit: &[&str] = match unit {
            Unit::Recording => &["status"],
            Unit::Window => &["start", "end", "status"],
            Unit::Vote => &["status", "windows"],
        };
        let named = columns.iter().map(|c| if c == target { "true" } else { c.as_str() });
        let all: Vec<&str> =
            ["id", "path"].into_iter().chain(by_unit.iter().copied()).chain(named).collect();
        let writer = PredictionWriter::new(out, form, &all, labels.names());
        let label_columns = columns.len();
        Self { writer, unit, label_columns, reject, written: 0, failed: 0, rejected: 0 }
    }

    /// Writes a line and hands it on at once.
    ///
    /// # Errors
    /// What the output refuses.
    pub fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        self.written += 1;
        self.failed += usize::from(record.class.is_none() || !record.status.has_features());
        let mut cells = vec![Cell::Text(record.id), Cell::Text(record.path)];
        if self.unit == Unit::Window {
            let (start, end) = match record.span {
                Some((start, end)) => (Cell::Seconds(start), Cell::Seconds(end)),
                None => (Cell::Absent, Cell::Absent),
            };
            cells.extend([start, end]);
        }
        cells.push(Cell::Text(record.status.name()));
        if self.unit == Unit::Vote {
            cells.push(Cell::Count(record.windows));
        }
        let label = |at: usize| record.labels.get(at).map_or(Cell::Absent, |text| Cell::Text(text));
        cells.extend((0..self.label_columns).map(label));
        let proba = record.proba.as_deref();
        let highest = proba.map(|p| p.iter().copied().fold(0.0, f64::max));
        let certain = highest.is_none_or(|p| p >= self.reject);
        self.rejected += usize::from(record.class.is_some() && !certain);
        self.writer.write(&cells, record.class.filter(|_| certain), proba)
    }

    /// Ends the output; gives back what was written to.
    ///
    /// # Errors
    /// What the output refuses.
    pub fn finish(self) -> io::Result<W> {
        self.writer.finish()
    }
}
