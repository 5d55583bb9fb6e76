//! What rows are held out together, and what is said of it.

use std::path::{Path, PathBuf};

use corsmal_files::npz::{Compression, NpzWriter};
use serde_json::Value;

use crate::command::{done, refused, run, text, written};

/// 24 rows in recordings of two, containers of four and two folds; neighbours look alike, whatever their class.
fn table(folder: &Path, recording: &str, more: &[(&str, usize)]) -> PathBuf {
    let path = folder.join("table.npz");
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    let x: Vec<f32> = (0..24).map(|row| (row / 2 * 37 % 23) as f32 + row as f32 / 100.0).collect();
    npz.floats("X", &[24, 1], &x).unwrap();
    let column = |value: &dyn Fn(usize) -> String| (0..24).map(value).collect::<Vec<_>>();
    let mut put = |name: &str, values: Vec<String>| {
        npz.strings(name, &values.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
    };
    put("kind", column(&|row| ["x", "y"][row / 2 % 2].into()));
    put(recording, column(&|row| format!("r{}", row / 2)));
    for (name, size) in more {
        put(name, column(&|row| format!("{name}{}", row / size)));
    }
    npz.finish().unwrap();
    path
}

fn validated(table: &Path, more: &[&str]) -> (Value, String) {
    let command = ["cross-validate", text(table), "--target", "kind", "--json"];
    let output = run(&[&command[..], more].concat());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    (serde_json::from_slice(&output.stdout).unwrap(), said)
}

/// Rows with one id were in training and test: all of them were right.
#[test]
fn ids_that_rows_share_are_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let knn = ["--classifier", "knn", "--set", "k=1"];
    for name in ["id", "ids", "recording"] {
        let (found, _) = validated(&table(folder.path(), name, &[]), &knn);
        assert_eq!(found["held_out"]["units"], 12, "{name}");
        assert!(found["held_out"]["scores"]["accuracy"].as_f64().unwrap() < 1.0, "{name}");
    }
}

/// Recordings were drawn, though the folds keep containers together; so were rows where there were none.
#[test]
fn containers_that_given_folds_keep_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    for recording in ["recording", "other"] {
        let table = table(folder.path(), recording, &[("container", 4), ("fold", 8), ("odd", 6)]);
        let units = |plan: &str| {
            let by = ["--cv", plan, "--classifier", "knn", "--set", "k=1"];
            validated(&table, &by).0["held_out"]["units"].clone()
        };
        assert_eq!(units("fold=fold"), 6, "{recording}");
        let split = if recording == "recording" { 12 } else { 24 };
        assert_eq!(units("fold=odd"), split, "{recording}: these folds split containers");
    }
}

/// A forest whose seed was set looked as if it had no random variation.
#[test]
fn seeds_that_nothing_takes_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let table = table(folder.path(), "recording", &[("container", 4)]);
    let forest = ["--classifier", "rf", "--set", "trees=5", "--seeds", "2"];
    let told = |more: &[&str]| validated(&table, &[&forest[..], more].concat()).1;
    assert!(told(&["--set", "seed=3"]).contains("all runs are the same"));
    assert!(told(&["--set", "random_state=3"]).contains("all runs are the same"));
    assert!(!told(&[]).contains("all runs"));
}

/// Files of `classify` carry a label `fold`, by which a comparison with held-out rows looked fair.
#[test]
fn a_label_called_fold_is_no_fold() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let held_out = put("a.csv", "id,fold,true,predicted,p_x,p_y\nr,1,x,y,0,1\ns,2,y,y,0,1\n");
    let seen =
        put("b.csv", "id,status,fold,true,predicted,p_x,p_y\nr,ok,1,x,x,1,0\ns,ok,2,y,y,0,1\n");
    for command in [
        &["compare-predictions", text(&held_out), text(&seen)][..],
        &["fuse", text(&held_out), text(&seen), "-o", "-"],
    ] {
        let output = run(command);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && said.contains("has folds and"), "{command:?}: {said}");
    }
}

/// The label of `7.wav` went to row 7.
#[test]
fn rows_without_ids_are_not_named_by_files() {
    let folder = tempfile::tempdir().unwrap();
    let table = table(folder.path(), "other", &[]);
    let lines = |ending: &str| -> String {
        (0..24).map(|row| format!("{row}{ending},{}\n", ["a", "b"][row % 2])).collect()
    };
    let labels = written(folder.path(), "l.csv", &format!("file,class\n{}", lines(".wav")));
    let by = ["--labels", text(&labels), "--id-column", "file", "--target", "class"];
    let refusal = refused(&[&["cross-validate", text(&table)], &by[..]].concat());
    assert!(refusal.contains("only numbered") && refusal.contains("\"0.wav\""), "{refusal}");
    written(folder.path(), "l.csv", &format!("file,class\n{}", lines("")));
    done(&[&["cross-validate", text(&table)], &by[..]].concat());
}
