//! The official evaluators' scores of the reference submissions.

#![allow(clippy::unwrap_used)]

mod shared_data;

use std::collections::BTreeMap;

use corsmal_ccm::dataset::{Annotations, Dimensions};
use corsmal_ccm::scores::{RuleSet, Scores, evaluate};
use corsmal_ccm::submission::{Format, RowKey, Submission, SubmissionRow};
use shared_data::ccm;

const TOLERANCE: f64 = 0.0101;

/// Rows of a score table as `(submission, column, value)`.
fn table(text: &str) -> Vec<(String, String, f64)> {
    let mut lines = text.lines();
    let header: Vec<_> = lines.next().unwrap().split(',').map(str::to_string).collect();
    lines
        .flat_map(|line| {
            let cells: Vec<_> = line.split(',').map(str::to_string).collect();
            header[1..]
                .iter()
                .zip(cells[1..].to_vec())
                .map(|(h, v)| (cells[0].clone(), h.clone(), v.parse().unwrap()))
                .collect::<Vec<_>>()
        })
        .collect()
}

fn compare(
    expected: Vec<(String, String, f64)>,
    score: impl Fn(&str) -> Scores,
    rename: fn(&str) -> &str,
) -> usize {
    let mut cache = BTreeMap::new();
    for (submission, column, value) in &expected {
        let scores = cache.entry(submission.clone()).or_insert_with(|| score(submission));
        let ours = scores.get(rename(column)).unwrap();
        assert!((ours - value).abs() < TOLERANCE, "{submission} {column}: {ours} for {value}");
    }
    expected.len()
}

#[test]
fn current_toolkit() {
    let Some(reference) = ccm("reference_scores_evaluator_head_3e689d8.csv") else { return };
    let annotations = Annotations::read(&ccm("ccm_train_annotation.csv").unwrap()).unwrap();
    let read = |name: &str| {
        Submission::read(&ccm(&format!("submissions/train_{name}.csv")).unwrap()).unwrap()
    };
    let baseline = read("random1");
    let expected = table(&std::fs::read_to_string(reference).unwrap());
    let n = compare(
        expected,
        |name| evaluate(&read(name), &annotations, &baseline, RuleSet::Toolkit, None).unwrap(),
        |c| c,
    );
    assert_eq!(n, 24 * 13);
}

/// The `test*` submissions of that table are the annotations themselves, some tasks each.
fn from_annotations(name: &str, annotations: &Annotations) -> Option<Submission> {
    let tasks: &[u8] = match name {
        "test1" => &[1, 2, 3, 4, 5],
        "test2" => &[1],
        "test3" => &[4],
        "test4" => &[1, 2],
        "test5" => &[1, 2, 3],
        "test7" => &[3],
        "test8" => &[2],
        "test9" => &[5],
        "test11" => &[1, 2, 3, 4],
        "test12" => &[],
        _ => return None,
    };
    let predictions: Vec<_> = annotations
        .rows
        .iter()
        .map(|row| {
            let has = |task| tasks.contains(&task);
            let filling = row.filling.unwrap();
            SubmissionRow {
                kind: has(2).then_some(filling.kind()),
                level: has(1).then_some(filling.level()),
                capacity_ml: has(3).then_some(row.capacity_ml),
                container_mass_g: has(4).then_some(row.container_mass_g),
                dimensions: row.dimensions.filter(|_| has(5)).map(|d| Dimensions { ..d }),
                ..SubmissionRow::empty(RowKey::Id(row.id.unwrap()))
            }
        })
        .collect();
    Some(Submission::from_predictions(name, Format::Y2022, &predictions))
}

#[test]
fn toolkit_of_november_2021() {
    let Some(reference) = ccm("reference_scores_evaluator_2021-11-10_9087f46.csv") else { return };
    let annotations = Annotations::read(&ccm("ccm_train_annotation_2021-11.csv").unwrap()).unwrap();
    let read = |name: &str| {
        Submission::read(&ccm(&format!("submissions/train_{name}.csv")).unwrap()).unwrap()
    };
    let baseline = read("random1");
    let expected = table(&std::fs::read_to_string(reference).unwrap());
    let n = compare(
        expected,
        |name| {
            let submission = from_annotations(name, &annotations).unwrap_or_else(|| read(name));
            evaluate(&submission, &annotations, &baseline, RuleSet::Toolkit202111, None).unwrap()
        },
        |c| c,
    );
    assert_eq!(n, 18 * 12);
}

#[test]
fn toolkit_of_october_2020() {
    let Some(reference) = ccm("reference_scores.csv") else { return };
    let annotations = Annotations::read(&ccm("ccm_train_annotation.csv").unwrap()).unwrap();
    let baseline =
        Submission::read(&ccm("submissions/train_2020-10_random123.csv").unwrap()).unwrap();
    let mut reader = csv::Reader::from_path(reference).unwrap();
    let expected: Vec<_> = reader
        .records()
        .map(|r| r.unwrap())
        .filter(|r| r[0].starts_with("evaluator v0.2"))
        .map(|r| (r[1].to_string(), r[2].to_string(), r[3].parse().unwrap()))
        .collect();
    let n = compare(
        expected,
        |name| {
            let path = ccm(&format!("submissions/train_{name}.csv")).unwrap();
            let submission = Submission::read(&path).unwrap();
            evaluate(&submission, &annotations, &baseline, RuleSet::Toolkit202010, None).unwrap()
        },
        |c| if c == "T4_mass_weighted" { "mass" } else { c },
    );
    assert_eq!(n, 36);
}

/// M6's predictions under ACC's own evaluation, restricted to its two lists of recordings.
#[test]
fn acc_lists() {
    let Some(reference) = ccm("reference_scores.csv") else { return };
    let annotations = Annotations::read(&ccm("acc_annotations.csv").unwrap()).unwrap();
    let submission = Submission::read(&ccm("other_predictions/m6_acc.csv").unwrap()).unwrap();
    let mut reader = csv::Reader::from_path(reference).unwrap();
    let mut compared = 0;
    for row in reader.records().map(|r| r.unwrap()) {
        if !row[0].starts_with("M6 acc.csv under ACC") {
            continue;
        }
        let (containers, list) = match &row[1] {
            "ccm_val (137 ids)" => ((1..=9).collect(), Some("acc_val_ids.txt")),
            "ccm_train (547 ids)" => ((1..=9).collect(), Some("acc_train_ids.txt")),
            "all 684" => ((1..=9).collect::<Vec<u8>>(), None),
            _ => ((16..=19).collect(), None),
        };
        let mut part = annotations.of_containers(&containers);
        if let Some(list) = list {
            let text = std::fs::read_to_string(ccm(list).unwrap()).unwrap();
            let ids: Vec<usize> =
                text.split(|c: char| !c.is_ascii_digit()).filter_map(|t| t.parse().ok()).collect();
            let mut index = 0;
            part.rows.retain(|_| {
                index += 1;
                ids.contains(&(index - 1))
            });
        }
        let aligned = submission.align(&part, &annotations).unwrap();
        let scores = evaluate(&aligned, &part, &aligned, RuleSet::Paper, None).unwrap();
        let name = match &row[2] {
            "type_weighted_f1" => "T2",
            "level_weighted_f1" => "T1",
            _ => "joint",
        };
        let value: f64 = row[3].parse().unwrap();
        let ours = scores.get(name).unwrap();
        assert!((ours - value).abs() < TOLERANCE, "{} {name}: {ours} for {value}", &row[1]);
        compared += 1;
    }
    assert_eq!(compared, 12);
}
