//! The report on a study of any labelled recordings.

#![allow(clippy::unwrap_used)]

use corsmal_plot::{ChannelPicture, RecordingPicture, WaveScale};
use corsmal_report::Fact;
use corsmal_report::study::{
    CalibrationBin, ClassCurve, ClassScore, Estimate, Estimates, Importance, LearningPoint,
    Prediction, Recording, Score, Study,
};
use ndarray::{Array2, arr2};

fn picture() -> RecordingPicture {
    RecordingPicture {
        title: "bark.ogg".into(),
        subtitle: "1 channel".into(),
        time: (0.0, 1.0),
        frequencies: vec![(1000.0, 0.4)],
        level_range: (-80.0, 0.0),
        level_label: "dB".into(),
        wave_scale: WaveScale::Shared,
        channels: vec![ChannelPicture {
            label: "ch 0".into(),
            notes: vec![],
            envelope: vec![(-0.5, 0.5); 20],
            levels: Array2::zeros((8, 20)),
        }],
    }
}

fn study() -> Study {
    let recording = |id: &str, notes: &[&str]| Recording {
        id: id.into(),
        class: Some(0),
        seconds: 5.0,
        sample_rate: 44_100,
        channels: 1,
        peak_dbfs: Some(-3.0),
        notes: notes.iter().map(|n| n.to_string()).collect(),
        failure: None,
    };
    let prediction = |id: &str, truth, predicted, confidence| Prediction {
        id: id.into(),
        truth,
        predicted,
        confidence,
        stretch: None,
    };
    let class = ClassScore { precision: 90.0, recall: 80.0, f1: 84.7, support: 20 };
    let family = |name: &str, loss| Importance {
        family: name.into(),
        features: 40,
        loss,
        range: (loss - 1.0, loss + 1.0),
    };
    let point = |rows, accuracy| LearningPoint { rows, accuracy, range: (accuracy, accuracy) };
    Study {
        title: "Barks & rain".into(),
        target: "class".into(),
        facts: vec![Fact::new("Classifier", "rf")],
        classes: vec!["dog".into(), "rain".into()],
        recordings: vec![
            recording("a", &[]),
            recording("b", &["ch 2 dead (constant)"]),
            Recording { id: "c".into(), failure: Some("not audio".into()), ..Recording::default() },
        ],
        examples: vec![(0, picture()), (1, picture())],
        scores: vec![Score { name: "accuracy".into(), value: 90.0, interval: Some((86.5, 92.75)) }],
        intervals: "95 % of 1,000 bootstrap resamples of the groups.".into(),
        protocol: "No row was trained on.".into(),
        folds: vec![("1".into(), vec![88.0])],
        seeds: vec![(7, vec![89.5])],
        measures: vec![("Brier score".into(), 0.25, "mean squared distance".into())],
        class_scores: vec![class, class],
        confusion: arr2(&[[16, 4, 0], [1, 18, 1]]),
        calibration: vec![CalibrationBin { confidence: 0.7, accuracy: 0.6, count: 12 }],
        curves: vec![ClassCurve {
            class: 1,
            roc: vec![(0.0, 0.0), (0.1, 0.9), (1.0, 1.0)],
            roc_auc: 0.9,
            precision_recall: vec![(0.0, 1.0), (1.0, 0.5)],
            average_precision: 0.85,
        }],
        importances: vec![family("zcr", 0.5), family("mfcc", 12.0)],
        learning: vec![point(40.0, 70.0), point(80.0, 80.0)],
        predictions: vec![
            prediction("right", 0, Some(0), Some(0.99)),
            prediction("unsure", 0, Some(1), Some(0.51)),
            prediction("sure", 1, Some(0), Some(0.97)),
            prediction("unanswered", 1, None, None),
        ],
    }
}

#[test]
fn every_part_is_there() {
    let report = study().report().unwrap();
    let ids: Vec<_> = report.sections.iter().map(|s| s.id.as_str()).collect();
    let all =
        ["scores", "confusion", "curves", "errors", "data", "examples", "importances", "learning"];
    assert_eq!(ids, all);
    assert!(report.summary.contains("accuracy 90.00 % (86.5 to 92.8) on 4 rows"));
    let html = report.html();
    for told in [
        "dead (constant)",
        "not audio",
        "none given",
        "dog: bark.ogg",
        "mfcc (40)",
        "seed 7",
        "0.2500",
    ] {
        assert!(html.contains(told), "{told}");
    }
}

#[test]
fn errors_are_listed_from_the_most_confident_on() {
    let report = study().report().unwrap();
    let errors = report.sections.iter().find(|s| s.id == "errors").unwrap();
    assert!(errors.text[0].starts_with("2 of 4 rows are wrong"));
    assert!(errors.text[0].ends_with("1 without a prediction."));
    let table = &errors.tables[0];
    let cell = |row: usize| format!("{:?}", table.rows[row].cells[0]);
    assert!(cell(0).contains("\"sure\"") && cell(1).contains("unsure"));
    // No row is a part of a recording.
    assert!(!table.columns.contains(&"Time".to_owned()));
    let mut parts = study();
    parts.predictions[2].stretch = Some((1.5, 2.0));
    let html = parts.report().unwrap().html();
    assert!(html.contains("1.50 to 2.00 s"));
}

/// A page of 200 classes took minutes to draw, one of 4,096 would have been gigabytes.
#[test]
fn very_many_classes_are_listed_and_not_drawn() {
    let class = ClassScore { precision: 90.0, recall: 80.0, f1: 84.7, support: 20 };
    let of = |count: usize| {
        let classes = (0..count).map(|i| format!("class {i}")).collect();
        let class_scores = vec![class; count];
        let many = Study { classes, class_scores, confusion: Array2::eye(count), ..study() };
        let report = many.report().unwrap();
        report.sections.into_iter().find(|s| s.id == "confusion").unwrap()
    };
    let (drawn, listed) = (of(100), of(101));
    assert_eq!((drawn.figures.len(), listed.figures.len()), (1, 0));
    assert_eq!(listed.tables[0].rows.len(), 101);
    assert!(listed.text[0].contains("more than 100 classes is not drawn"), "{:?}", listed.text);
}

#[test]
fn what_is_not_known_is_left_out() {
    let bare = Study { title: "t".into(), target: "class".into(), ..Study::default() };
    let report = bare.report().unwrap();
    assert!(report.sections.is_empty() && report.summary == "class: 0 classes.");
    let mut blind = study();
    blind.curves.clear();
    blind.recordings.clear();
    blind.examples.clear();
    blind.learning.truncate(1);
    let report = blind.report().unwrap();
    let ids: Vec<_> = report.sections.iter().map(|s| s.id.as_str()).collect();
    assert_eq!(ids, ["scores", "confusion", "errors", "importances"]);
}

#[test]
fn estimates_are_drawn_and_the_largest_errors_listed() {
    let row = |id: &str, truth, estimate| Estimate { id: id.into(), truth, estimate };
    let estimates = Estimates {
        title: "Capacities".into(),
        target: "capacity".into(),
        measures: vec![("mean absolute error".into(), "12.5".into())],
        rows: vec![
            row("near", 100.0, Some(101.0)),
            row("far", 100.0, Some(140.0)),
            row("none", 50.0, None),
        ],
        ..Estimates::default()
    };
    let report = estimates.report().unwrap();
    assert_eq!(report.summary, "capacity: 3 rows, 1 of them without an estimate.");
    let ids: Vec<String> =
        report.sections[1].tables[0].rows.iter().map(|r| format!("{:?}", r.cells[0])).collect();
    assert!(ids[0].contains("none") && ids[1].contains("far") && ids[2].contains("near"));
    assert!(report.html().contains("mean absolute error"));
    assert!(Estimates::default().report().is_ok());
}
