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

/// Columns that tell how a line came about: no label column is called so.
const RESERVED: [&str; 7] = ["id", "path", "start", "end", "status", "windows", "predicted"];

/// Writes records of one unit.
pub struct RecordWriter<W> {
    writer: PredictionWriter<W>,
    unit: Unit,
    /// which label columns are written
    carried: Vec<usize>,
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
    /// called `true`, and columns that are called like others of the file are left out. Predictions
    /// with a highest probability below `reject` are unknown.
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
        let mut all: Vec<&str> =
            ["id", "path"].into_iter().chain(by_unit.iter().copied()).collect();
        let has_target = columns.iter().any(|column| column == target);
        let mut carried = Vec::new();
        for (at, column) in columns.iter().enumerate() {
            let name = if column == target { "true" } else { column.as_str() };
            // Readers ignore case.
            let is = |other: &&str| other.eq_ignore_ascii_case(name);
            let own = RESERVED.iter().any(is) || name.starts_with("p_");
            let replaced = has_target && column.eq_ignore_ascii_case("true") && column != target;
            if !own && !replaced && !all.iter().any(is) {
                all.push(name);
                carried.push(at);
            }
        }
        let writer = PredictionWriter::new(out, form, &all, labels.names());
        Self { writer, unit, carried, reject, written: 0, failed: 0, rejected: 0 }
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
        cells.extend(self.carried.iter().map(|&at| label(at)));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn label_columns_do_not_hide_those_of_the_file() {
        let columns = ["id", "type", "site", "true", "p_rice", "status"].map(String::from);
        let labels = Labels::new(vec!["rice".into(), "water".into()]).unwrap();
        let form = (Form::Csv, Unit::Recording);
        let mut writer = RecordWriter::new(Vec::new(), form, &labels, (&columns, "type"), 0.7);
        let mut record = Record {
            id: "x",
            path: "x.wav",
            span: None,
            windows: 0,
            status: Status::Ok,
            labels: vec!["7", "rice", "A", "no", "0.5", "fine"],
            class: Some(0),
            proba: Some(vec![0.75, 0.25]),
        };
        writer.write(&record).unwrap();
        record.proba = Some(vec![0.625, 0.375]);
        writer.write(&record).unwrap();
        assert_eq!((writer.written, writer.failed, writer.rejected), (2, 0, 1));
        let text = String::from_utf8(writer.finish().unwrap()).unwrap();
        assert_eq!(
            text,
            "id,path,status,true,site,predicted,p_rice,p_water\n\
             x,x.wav,ok,rice,A,rice,0.75,0.25\nx,x.wav,ok,rice,A,unknown,0.625,0.375\n"
        );
    }
}
