//! Writing submissions, checked first.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use corsmal_files::draft;
use corsmal_models::predictions::SUM_TOLERANCE;

use super::{Estimates, Format, RowKey, Submission};
use crate::dataset::{Dimensions, FillingLevel, FillingType};
use crate::error::{CcmError, Result};

const HEADER_2022: &str = "Configuration ID,Container capacity,Container mass,Filling mass,None,\
Pasta,Rice,Water,Filling type,Empty,Half-full,Full,Filling level,Width at the top,\
Width at the bottom,Height,Object safety,Distance,Angle difference,Execution time";

const HEADER_2020: &str = "Container ID,Sequence,Filling type,Filling level,Container Capacity";

/// What is estimated for one recording; `None` is written as -1.
#[derive(Clone, Debug, PartialEq)]
pub struct SubmissionRow {
    /// The recording.
    pub key: RowKey,
    /// Filling type.
    pub kind: Option<FillingType>,
    /// Probability of none, pasta, rice, water.
    pub kind_probabilities: Option<[f64; 4]>,
    /// Filling level.
    pub level: Option<FillingLevel>,
    /// Probability of empty, half, full.
    pub level_probabilities: Option<[f64; 3]>,
    /// Capacity in mL.
    pub capacity_ml: Option<f64>,
    /// Mass of the empty container in g.
    pub container_mass_g: Option<f64>,
    /// Dimensions in mm.
    pub dimensions: Option<Dimensions>,
    /// Execution time in ms.
    pub execution_ms: Option<f64>,
}

impl SubmissionRow {
    /// Nothing estimated.
    pub fn empty(key: RowKey) -> Self {
        Self {
            key,
            kind: None,
            kind_probabilities: None,
            level: None,
            level_probabilities: None,
            capacity_ml: None,
            container_mass_g: None,
            dimensions: None,
            execution_ms: None,
        }
    }

    fn fault(&self) -> Option<String> {
        for p in [
            self.kind_probabilities.map(|p| p.to_vec()),
            self.level_probabilities.map(|p| p.to_vec()),
        ]
        .into_iter()
        .flatten()
        {
            let sum: f64 = p.iter().sum();
            // Written this way round so that NaN is a fault too.
            let is_one = |v: &f64| (0.0..=1.0 + SUM_TOLERANCE).contains(v);
            if !(p.iter().all(is_one) && (sum - 1.0).abs() <= SUM_TOLERANCE) {
                return Some(format!("probabilities {p:?} are not in 0 to 1 with sum 1"));
            }
        }
        let sizes = self.dimensions.map(|d| [d.width_top, d.width_bottom, d.height]);
        let positive = [self.capacity_ml, self.container_mass_g, self.execution_ms]
            .into_iter()
            .flatten()
            .chain(sizes.into_iter().flatten());
        for value in positive {
            if !(value.is_finite() && value >= 0.0) {
                return Some(format!("{value} is not a size, a mass or a time"));
            }
        }
        None
    }
}

impl Submission {
    /// A submission held in memory, with all of [`SubmissionRow`]'s estimates.
    pub fn from_predictions(name: &str, format: Format, predictions: &[SubmissionRow]) -> Self {
        let column = |value: &dyn Fn(&SubmissionRow) -> Option<f64>| Estimates {
            values: predictions.iter().map(|p| value(p).unwrap_or(-1.0)).collect(),
            float: false,
        };
        let unmeasured = column(&|_| None);
        Self {
            path: name.into(),
            format,
            keys: predictions.iter().map(|p| p.key).collect(),
            kind: column(&|p| p.kind.map(|k| k as i32 as f64)),
            level: column(&|p| p.level.map(|l| l as i32 as f64)),
            capacity: column(&|p| p.capacity_ml),
            container_mass: column(&|p| p.container_mass_g),
            width_top: column(&|p| p.dimensions.map(|d| d.width_top)),
            width_bottom: column(&|p| p.dimensions.map(|d| d.width_bottom)),
            height: column(&|p| p.dimensions.map(|d| d.height)),
            safety: unmeasured.clone(),
            distance: unmeasured.clone(),
            angle: unmeasured,
            notes: Vec::new(),
        }
    }

    /// Writes predictions in an official format, in the order of `expected` (the official scripts
    /// pair rows by position); the file appears only when complete.
    ///
    /// # Errors
    /// [`CcmError`] when keys are not of the format, are doubled, or are not exactly those of
    /// `expected`; when probabilities or sizes are out of range; when the file cannot be written.
    pub fn write(
        path: &Path,
        format: Format,
        predictions: &[SubmissionRow],
        expected: &[RowKey],
    ) -> Result<()> {
        let by_key = check(path, format, predictions, expected)?;
        let mut text = String::from(match format {
            Format::Y2020 => HEADER_2020,
            Format::Y2022 => HEADER_2022,
        });
        for p in expected.iter().filter_map(|key| by_key.get(key)) {
            text.push('\n');
            text.push_str(&row(p));
        }
        text.push('\n');
        draft::write(path, text.as_bytes()).map_err(CcmError::Write)
    }
}

fn check<'a>(
    path: &Path,
    format: Format,
    predictions: &'a [SubmissionRow],
    expected: &[RowKey],
) -> Result<HashMap<RowKey, &'a SubmissionRow>> {
    let rows_error = |problem, rows: String| CcmError::Rows {
        path: path.to_path_buf(),
        problem,
        rows,
        expected: format!("{} recordings", expected.len()),
    };
    let mut missing: HashSet<RowKey> = expected.iter().copied().collect();
    for p in predictions {
        let fits = matches!(
            (format, p.key),
            (Format::Y2022, RowKey::Id(_)) | (Format::Y2020, RowKey::Sequence(..))
        );
        if !fits {
            let by = match format {
                Format::Y2020 => "container and sequence",
                Format::Y2022 => "id",
            };
            return Err(CcmError::Request(format!(
                "{}: {} does not fit this format, which names rows by {by}; --annotations \
                 translates between them",
                path.display(),
                p.key
            )));
        }
        if !missing.remove(&p.key) {
            return Err(rows_error("an unexpected or doubled row", p.key.to_string()));
        }
        if let Some(fault) = p.fault() {
            return Err(CcmError::Request(format!("{}: {}: {fault}", path.display(), p.key)));
        }
    }
    match missing.into_iter().min() {
        Some(key) => Err(rows_error("missing rows", key.to_string())),
        None => Ok(predictions.iter().map(|p| (p.key, p)).collect()),
    }
}

fn row(p: &SubmissionRow) -> String {
    let number = |v: Option<f64>| v.map_or("-1".into(), |v| v.to_string());
    let label = |v: Option<usize>| v.map_or("-1".into(), |v| v.to_string());
    let kind = label(p.kind.map(|k| k as usize));
    let level = label(p.level.map(|l| l as usize));
    match p.key {
        RowKey::Sequence(container, sequence) => {
            format!("{container},{sequence},{kind},{level},{}", number(p.capacity_ml))
        }
        RowKey::Id(id) => {
            let probabilities = |values: Option<&[f64]>, n: usize| match values {
                Some(v) => {
                    v.iter().map(|v| format!("{:.6}", v.min(1.0))).collect::<Vec<_>>().join(",")
                }
                None => vec!["-1"; n].join(","),
            };
            format!(
                "{id},{},{},-1,{},{kind},{},{level},{},{},{},-1,-1,-1,{}",
                number(p.capacity_ml),
                number(p.container_mass_g),
                probabilities(p.kind_probabilities.as_ref().map(|p| p.as_slice()), 4),
                probabilities(p.level_probabilities.as_ref().map(|p| p.as_slice()), 3),
                number(p.dimensions.map(|d| d.width_top)),
                number(p.dimensions.map(|d| d.width_bottom)),
                number(p.dimensions.map(|d| d.height)),
                number(p.execution_ms),
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(key: RowKey) -> SubmissionRow {
        SubmissionRow {
            kind: Some(FillingType::Rice),
            kind_probabilities: Some([0.1, 0.2, 0.6, 0.1]),
            level: Some(FillingLevel::Full),
            capacity_ml: Some(320.5),
            ..SubmissionRow::empty(key)
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        for (format, keys) in [
            (Format::Y2022, [RowKey::Id(1), RowKey::Id(0)]),
            (Format::Y2020, [RowKey::Sequence(1, 0), RowKey::Sequence(1, 1)]),
        ] {
            let path = dir.path().join("s.csv");
            let predictions = [example(keys[0]), SubmissionRow::empty(keys[1])];
            let mixed = [predictions[1].clone(), predictions[0].clone()];
            Submission::write(&path, format, &mixed, &keys).unwrap();
            let read = Submission::read(&path).unwrap();
            let held = Submission::from_predictions("s", format, &predictions);
            assert_eq!(read.keys, held.keys);
            assert_eq!(read.kind.values, [2.0, -1.0]);
            assert_eq!(read.level.values, held.level.values);
            assert_eq!(read.capacity.values, [320.5, -1.0]);
            assert!(!read.kind.float);
        }
    }

    #[test]
    fn refuses_before_writing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let (a, b) = (RowKey::Id(0), RowKey::Id(1));
        let mut bad = example(a);
        bad.kind_probabilities = Some([0.5, 0.5, 0.5, 0.0]);
        let mut nan = example(a);
        nan.capacity_ml = Some(f64::NAN);
        let cases = [
            (vec![example(a)], vec![a, b], "missing rows: id 1"),
            (vec![example(a), example(a)], vec![a, b], "doubled row: id 0"),
            (vec![example(b)], vec![a], "unexpected or doubled row: id 1"),
            (vec![bad], vec![a], "probabilities"),
            (vec![nan], vec![a], "NaN is not a size"),
            (vec![example(RowKey::Sequence(1, 0))], vec![a], "does not fit this format"),
        ];
        for (predictions, expected, message) in cases {
            let error = Submission::write(&path, Format::Y2022, &predictions, &expected);
            let error = error.unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
            assert!(!path.exists());
        }
        // Sums of float32 may be a little above one.
        let rounded =
            SubmissionRow { kind_probabilities: Some([0.0, 0.0, 1.000_000_06, 0.0]), ..example(a) };
        Submission::write(&path, Format::Y2022, &[rounded], &[a]).unwrap();
        let written = std::fs::read_to_string(&path).unwrap();
        assert!(written.contains(",0.000000,0.000000,1.000000,0.000000,"), "{written}");
        std::fs::remove_file(&path).unwrap();
        // What cannot take the name leaves nothing behind.
        std::fs::create_dir(&path).unwrap();
        let written = Submission::write(&path, Format::Y2022, &[example(a)], &[a]);
        let error = written.unwrap_err().to_string();
        assert_eq!(error.matches(path.to_str().unwrap()).count(), 1, "{error}");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }
}
