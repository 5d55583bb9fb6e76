//! The report on scored predictions.

use std::path::{Path, PathBuf};

use corsmal_models::predictions::PredictionTable;
use corsmal_models::scores::{ClassReport, Interval, Scoring, no_estimate};
use corsmal_report::Fact;
use corsmal_report::study::{
    CalibrationBin, ClassCurve, ClassScore, Estimate, Estimates, Prediction, Score, Study,
};
use ndarray::Array2;

use super::page::{add_file, add_made, file_name, write};
use super::recordings::{self, Source};
use crate::failure::Failure;

/// What was scored, and how.
pub struct Scored<'a> {
    /// The predictions.
    pub predictions: &'a PredictionTable,
    /// The file with the true values, where there is one.
    pub labels: Option<&'a Path>,
    /// The column of the true values.
    pub target: Option<&'a str>,
    /// How the bootstrap draws.
    pub scoring: &'a Scoring,
}

impl Scored<'_> {
    fn add_facts(&self, facts: &mut Vec<Fact>) {
        add_file(facts, "Predictions", &self.predictions.path);
        if let Some(labels) = self.labels {
            add_file(facts, "Labels", labels);
        }
        let Scoring { draws, seed, .. } = self.scoring;
        facts.push(Fact::new("Bootstrap", format!("{draws} resamples, seed {seed}")));
    }
}

/// Writes the report of scored predictions of classes into a folder.
pub fn write_scored(
    folder: &Path,
    scored: &Scored<'_>,
    scores: &ClassReport,
) -> Result<(), Failure> {
    let Scored { predictions, target, .. } = *scored;
    let mut study = Study {
        title: format!("Scores of {}", file_name(&predictions.path)),
        target: target.unwrap_or("class").into(),
        protocol: "The scores are honest only if the model was trained without these recordings, which this \
                   report cannot check."
            .into(),
        ..of_predictions(predictions, target, scores)?
    };
    if let Some(paths) = predictions.column("path") {
        let sources = predictions.rows.iter().zip(paths).zip(&study.predictions);
        let sources = sources.map(|((row, path), prediction)| Source {
            id: row.key.0.clone(),
            path: PathBuf::from(path),
            class: Some(prediction.truth),
            stretch: prediction.stretch,
            identity: String::new(),
            unused: None,
        });
        let sources = sources.collect();
        recordings::add(&mut study, sources, false);
    }
    scored.add_facts(&mut study.facts);
    study.facts.push(Fact::new("Rows", scores.rows.to_string()));
    add_made(&mut study.facts);
    write(folder, &study.report()?, false)
}

/// Writes the report of scored numbers, with the measures of their errors, into a folder.
pub fn write_estimates(
    folder: &Path,
    scored: &Scored<'_>,
    measures: Vec<(String, String)>,
) -> Result<(), Failure> {
    let Scored { predictions, target, .. } = *scored;
    let number = |text: &str| text.parse::<f64>().ok();
    let truth = predictions.truth(target)?;
    let truth: Vec<f64> = truth.iter().map(|text| number(text).unwrap_or(f64::NAN)).collect();
    let none = no_estimate(&truth);
    let rows = predictions.rows.iter().zip(&truth).map(|(row, &truth)| {
        let text = row.class.map(|class| predictions.labels[class].as_str());
        let estimate = text.and_then(number).filter(|value| Some(*value) != none);
        Estimate { id: row.key.0.clone(), truth, estimate }
    });
    let mut estimates = Estimates {
        title: format!("Scores of {}", file_name(&predictions.path)),
        target: target.unwrap_or("the number").into(),
        facts: Vec::new(),
        measures,
        rows: rows.collect(),
    };
    scored.add_facts(&mut estimates.facts);
    add_made(&mut estimates.facts);
    write(folder, &estimates.report()?, false)
}

/// What the scores and the predictions themselves tell.
pub(super) fn of_predictions(
    predictions: &PredictionTable,
    target: Option<&str>,
    scores: &ClassReport,
) -> Result<Study, Failure> {
    let score = |name: &str, value: f64, interval: &Interval| Score {
        name: name.into(),
        value: 100.0 * value,
        interval: Some((100.0 * interval.low, 100.0 * interval.high)),
    };
    let (s, i) = (&scores.scores, &scores.intervals);
    let n = scores.labels.len();
    let confusion = Array2::from_shape_fn((n, n + 1), |(truth, estimate)| match estimate {
        _ if estimate == n => s.unknown[truth],
        _ => s.confusion[truth][estimate],
    });
    let classes = s.classes.iter().map(|c| ClassScore {
        precision: 100.0 * c.precision,
        recall: 100.0 * c.recall,
        f1: 100.0 * c.f1,
        support: c.support as usize,
    });
    let bins = scores.calibration.iter().flat_map(|c| &c.bins).map(|bin| CalibrationBin {
        confidence: bin.confidence,
        accuracy: bin.accuracy,
        count: bin.rows,
    });
    let curves = scores.curves.iter().flatten().enumerate().filter_map(|(class, curve)| {
        let curve = curve.as_ref()?;
        Some(ClassCurve {
            class,
            roc: curve.roc.clone(),
            roc_auc: curve.roc_auc,
            precision_recall: curve.precision_recall.clone(),
            average_precision: curve.average_precision,
        })
    });
    let drawn = match scores.drawn.as_str() {
        "rows" => format!("of {} rows", scores.units),
        column => format!("of the {} groups (column {column})", scores.units),
    };
    Ok(Study {
        classes: scores.labels.clone(),
        scores: vec![
            score("accuracy", s.accuracy, &i.accuracy),
            score("weighted F1", s.weighted_f1, &i.weighted_f1),
            score("macro F1", s.macro_f1, &i.macro_f1),
        ],
        intervals: format!("Intervals hold 95 % of bootstrap samples {drawn}."),
        measures: measures(scores),
        class_scores: classes.collect(),
        confusion,
        calibration: bins.collect(),
        curves: curves.collect(),
        predictions: listed(predictions, target, &scores.labels)?,
        ..Study::default()
    })
}

fn measures(scores: &ClassReport) -> Vec<(String, f64, String)> {
    let mut measures = Vec::new();
    if let Some(calibration) = &scores.calibration {
        let brier = match scores.labels.len() {
            2 => "mean squared distance of the probability from the truth; 0 is perfect",
            _ => "mean squared distance of the probabilities from the truth, 0 to 2; 0 is perfect",
        };
        measures.push(("Brier score".into(), calibration.brier, brier.into()));
        let ece = "mean gap between confidence and share of right predictions; 0 is perfect";
        measures.push(("Expected calibration error".into(), calibration.ece, ece.into()));
    }
    let class_mean = "mean over the classes, each against all others; 1 is perfect";
    for (name, value) in [
        ("Area under the ROC curve", scores.roc_auc),
        ("Average precision", scores.average_precision),
    ] {
        measures.extend(value.map(|value| (name.to_owned(), value, class_mean.to_owned())));
    }
    measures
}

fn listed(
    predictions: &PredictionTable,
    target: Option<&str>,
    labels: &[String],
) -> Result<Vec<Prediction>, Failure> {
    let seconds = |column: &str| -> Vec<Option<f64>> {
        let values = predictions.column(column).unwrap_or_default();
        values.into_iter().map(|text| text.parse().ok()).collect()
    };
    let (starts, ends) = (seconds("start"), seconds("end"));
    let truth = predictions.truth(target)?;
    let rows = predictions.rows.iter().zip(truth).enumerate().map(|(at, (row, truth))| {
        let at = |list: &[Option<f64>]| list.get(at).copied().flatten();
        Prediction {
            id: row.key.0.clone(),
            truth: labels.iter().position(|label| label == truth).unwrap_or(labels.len()),
            predicted: row.class,
            confidence: row.class.zip(row.proba.as_ref()).and_then(|(c, p)| p.get(c).copied()),
            stretch: at(&starts).zip(at(&ends)),
        }
    });
    Ok(rows.collect())
}
