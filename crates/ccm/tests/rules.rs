//! The rule sets on small cases made by hand.

#![allow(clippy::unwrap_used)]

use std::io::Write;
use std::path::PathBuf;

use corsmal_ccm::dataset::Annotations;
use corsmal_ccm::scores::{RuleSet, Scores, evaluate};
use corsmal_ccm::submission::{RowKey, Submission, pseudo_random};

/// Container 1: empty, half pasta, full rice, full water; masses as its densities of 2020 give.
const ANNOTATIONS: &str = "\
id,container id,scenario,background,illumination,width at the top,width at the bottom,height,depth,\
container capacity,container mass,filling type,filling level,filling density,filling mass
0,1,0,0,0,90,60,120,-1,520,10,0,0,0,0
1,1,0,0,0,90,60,120,-1,520,10,1,1,0.34,109.2
2,1,0,0,0,90,60,120,-1,520,10,2,2,0.82,397.8
3,1,0,0,0,90,60,120,-1,520,10,3,2,1.0,468
";

const HEADER: &str = "Configuration ID,Container capacity,Container mass,Filling mass,None,Pasta,\
Rice,Water,Filling type,Empty,Half-full,Full,Filling level,Width at the top,Width at the bottom,\
Height,Object safety,Distance,Angle difference,Execution time";

/// Capacity, type and level of each row as written.
fn score_rows(rows: [[&str; 3]; 4], rules: RuleSet) -> Scores {
    let text: String = rows
        .iter()
        .enumerate()
        .map(|(id, [capacity, kind, level])| {
            format!(
                "{id},{capacity},10,-1,-1,-1,-1,-1,{kind},-1,-1,-1,{level},90,60,120,-1,-1,-1,-1\n"
            )
        })
        .collect();
    score(&format!("{HEADER}\n{text}"), rules)
}

fn score(submission: &str, rules: RuleSet) -> Scores {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| -> PathBuf {
        let path = dir.path().join(name);
        std::fs::File::create(&path).unwrap().write_all(text.as_bytes()).unwrap();
        path
    };
    let annotations = Annotations::read(&write("a.csv", ANNOTATIONS)).unwrap();
    let submission = Submission::read(&write("s.csv", submission)).unwrap();
    let keys: Vec<_> = (0..4).map(RowKey::Id).collect();
    let baseline = Submission::from_predictions("b", submission.format, &pseudo_random(&keys, 1));
    evaluate(&submission, &annotations, &baseline, rules, None).unwrap()
}

const RIGHT: [[&str; 3]; 4] =
    [["520", "0", "0"], ["520", "1", "1"], ["520", "2", "2"], ["520", "3", "2"]];

fn close(scores: &Scores, name: &str, expected: f64) {
    let value = scores.get(name).unwrap();
    assert!((value - expected).abs() < 1e-9, "{name}: {value}, expected {expected}");
}

/// In an empty container it earned exp(-mass), which is more than 1.
#[test]
fn a_mass_below_zero_earns_nothing_in_the_paper() {
    let mut rows = RIGHT;
    rows[0] = ["-2.4", "1", "2"];
    close(&score_rows(rows, RuleSet::Paper), "mass", 75.0);
}

#[test]
fn everything_right() {
    let paper = score_rows(RIGHT, RuleSet::Paper);
    for name in ["T1", "T2", "T3", "mass", "joint"] {
        close(&paper, name, 100.0);
    }
    close(&paper, "weight_error_N", 0.0);
    // The old evaluator adds .00493 even so.
    close(&score_rows(RIGHT, RuleSet::Toolkit202010), "mass", 100.493);
    // The current one weighs pasta with .34 for all containers: 88.4 g for 109.2 g, and rice with
    // .82: 383.76 g for 397.8 g.
    let toolkit = score_rows(RIGHT, RuleSet::Toolkit);
    let (pasta, rice) = (1.0 - 0.34 / 0.42, 1.0 - 0.82 / 0.85);
    let s8 = (2.0 + f64::exp(-pasta) + f64::exp(-rice)) / 4.0 + 0.047505;
    close(&toolkit, "s8", 100.0 * s8);
    close(&toolkit, "overall", (600.0 - 100.0 + 100.0 * s8) / 8.0);
    close(&toolkit, "CMD", 100.0);
}

#[test]
fn float_labels_match_nothing_as_text() {
    let mut rows = RIGHT;
    rows[1][1] = "1.0";
    let toolkit = score_rows(rows, RuleSet::Toolkit);
    close(&toolkit, "s2", 0.0);
    close(&toolkit, "s1", 100.0);
    close(&toolkit, "JFLT", 100.0);
    assert!(toolkit.notes.iter().any(|n| n.contains("floating-point")));
    close(&score_rows(rows, RuleSet::Paper), "T2", 100.0);
}

#[test]
fn never_full_makes_half_match_nothing_jointly() {
    let mut rows = RIGHT;
    rows[2][2] = "1";
    rows[3][2] = "1";
    let toolkit = score_rows(rows, RuleSet::Toolkit);
    // Only the empty row is right jointly: F1 1 for it, support 1 of 4.
    close(&toolkit, "JFLT", 25.0);
    // By value, half pasta is right as well.
    close(&score_rows(rows, RuleSet::Paper), "joint", 50.0);
}

#[test]
fn levels_in_percent() {
    let mut rows = RIGHT;
    for row in &mut rows {
        row[2] = match row[2] {
            "1" => "50",
            "2" => "90",
            other => other,
        };
    }
    for name in ["s1", "JFLT"] {
        close(&score_rows(rows, RuleSet::Toolkit), name, 100.0);
    }
    close(&score_rows(rows, RuleSet::Paper), "T1", 100.0);
    // In 2020 '50' is not '1': only the empty row matches.
    close(&score_rows(rows, RuleSet::Toolkit202010), "T1", 25.0);
}

#[test]
fn wrong_type_changes_the_mass_of_the_paper_only() {
    let mut rows = RIGHT;
    rows[0] = ["520", "3", "2"];
    // Water estimated in an empty container: the error is 468 in grams.
    close(&score_rows(rows, RuleSet::Paper), "mass", 75.0);
    let right = score_rows(RIGHT, RuleSet::Toolkit).get("s8").unwrap();
    close(&score_rows(rows, RuleSet::Toolkit), "s8", right);
}

/// Its density was taken for 0, which made empty containers right.
#[test]
fn a_row_without_a_type_has_no_mass_in_the_paper() {
    let mut rows = RIGHT;
    (rows[0][1], rows[2][1]) = ("-1", "-1");
    close(&score_rows(rows, RuleSet::Paper), "mass", 50.0);
}

#[test]
fn tasks_not_addressed_weigh_the_mass() {
    let mut rows = RIGHT;
    for row in &mut rows {
        row[0] = "-1";
    }
    let newer = score_rows(rows, RuleSet::Toolkit);
    let older = score_rows(rows, RuleSet::Toolkit202111);
    close(&newer, "s3", 0.0);
    close(&newer, "s8", older.get("s8").unwrap() * 2.0 / 3.0);
    assert!(newer.notes.iter().any(|n| n.contains("2 of the 3 tasks")));
    // Container mass, dimensions, type, level: 4 of 5 tasks.
    let sum: f64 = (1..=10).map(|i| older.get(&format!("s{i}")).unwrap()).sum();
    close(&older, "overall", sum / 10.0 * 0.8);
}

#[test]
fn missing_and_extra_rows_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    std::fs::write(&path, ANNOTATIONS).unwrap();
    let annotations = Annotations::read(&path).unwrap();
    let with = |n: u32| {
        let keys: Vec<_> = (0..n).map(RowKey::Id).collect();
        let format = corsmal_ccm::submission::Format::Y2022;
        Submission::from_predictions("s", format, &pseudo_random(&keys, 1))
    };
    let run = |n| {
        evaluate(&with(n), &annotations, &with(4), RuleSet::Toolkit, None).unwrap_err().to_string()
    };
    assert!(run(3).contains("missing rows: id 3"));
    assert!(run(5).contains("rows that the annotations lack: id 4"));
}

/// An amount that is withheld scored as its exponential: 1e30, or a little too much.
#[test]
fn amounts_that_are_withheld_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let row = "1,1,0,0,0,90,60,120,-1,520,10,1,1,0.34,109.2";
    let run = |other: &str, estimated: &str, rules: RuleSet| {
        let put = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let annotations = Annotations::read(&put("a.csv", &ANNOTATIONS.replace(row, other)));
        let line = |id: usize| format!("{id},520,{estimated},-1,-1,-1,-1\n");
        let text: String = (0..4).map(line).collect();
        let submission = Submission::read(&put("s.csv", &format!("{HEADER}\n{text}"))).unwrap();
        let keys: Vec<_> = (0..4).map(RowKey::Id).collect();
        let baseline =
            Submission::from_predictions("b", submission.format, &pseudo_random(&keys, 1));
        evaluate(&submission, &annotations.unwrap(), &baseline, rules, None)
    };
    let all = "10,-1,-1,-1,-1,-1,1,-1,-1,-1,1,90,60,120";
    let tasks = "-1,-1,-1,-1,-1,-1,1,-1,-1,-1,1,-1,-1,-1";
    let (paper, toolkit) = (RuleSet::Paper, RuleSet::Toolkit);
    let cases = [
        ("1,1,0,0,0,90,60,120,-1,520,10,1,1,0.34,", "filling mass", &[toolkit][..]),
        ("1,1,0,0,0,90,60,120,-1,520,10,1,1,0.34,-1", "filling mass", &[toolkit]),
        ("1,1,0,0,0,90,60,120,-1,520,10,1,1,,109.2", "filling density", &[toolkit]),
        ("1,1,0,0,0,90,60,120,-1,520,,1,1,0.34,109.2", "container mass", &[toolkit]),
        ("1,1,0,0,0,90,60,-1,-1,520,10,1,1,0.34,109.2", "size", &[toolkit]),
        ("1,1,0,0,0,90,60,120,-1,-1,10,1,1,0.34,109.2", "capacity", &[paper, toolkit]),
    ];
    for (other, what, all_rules) in cases {
        for &rules in all_rules {
            let refused = run(other, all, rules).unwrap_err().to_string();
            let expected = format!("the {what} of container 1 is withheld");
            assert!(refused.contains(&expected), "{what}: {refused}");
        }
    }
    // What nobody estimated needs no truth.
    for (other, what, _) in &cases[3..5] {
        assert!(run(other, tasks, toolkit).is_ok(), "{what}");
    }
    // The paper's other scores stand by themselves.
    let scores = run(cases[0].0, all, paper).unwrap();
    assert!(scores.get("T1").is_some() && scores.get("mass").is_none());
    assert!(scores.get("weight_error_N").is_none());
    assert!(scores.notes[0].contains("that of container 1 is withheld"), "{:?}", scores.notes);
    let scores = run(cases[3].0, all, paper).unwrap();
    assert!(scores.get("mass").is_some() && scores.get("weight_error_N").is_none());
}
