//! Rows of arrays of other programs.

use corsmal_files::npz::{Compression, NpzWriter};
use serde_json::{Value, json};

use super::support::{Files, text};

/// Rows were compared by their numbers, whatever `ids` said.
#[test]
fn rows_of_other_programs_are_paired_by_their_ids() {
    let files = Files::new();
    let write = |name: &str, ids: &[&str], value: &dyn Fn(usize) -> f32| {
        let mut writer = NpzWriter::create(&files.path(name), Compression::Stored).unwrap();
        let number = |id: &str| usize::from(id.as_bytes()[id.len() - 1]);
        let values = ids.iter().flat_map(|id| (0..5).map(move |k| 10 * number(id) + k));
        let values: Vec<f32> = values.map(value).collect();
        writer.floats("X", &[ids.len(), 5], &values).unwrap();
        let names: Vec<String> = ids.iter().map(|id| format!("of {}", number(id))).collect();
        writer.strings("y", &names).unwrap();
        writer.floats("mel", &[3], &[1.0, 2.0, 3.0]).unwrap();
        writer.strings("ids", ids).unwrap();
        writer.finish().unwrap();
    };
    let same = |at: usize| at as f32;
    write("a.npz", &["r1", "r2", "r3", "r4"], &same);
    write("b.npz", &["r3", "r1", "r4", "r2"], &same);
    let out = files.run("a.npz", "b.npz", &[]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stdout));
    assert!(
        text(&out.stdout)
            .contains("\n4 rows paired by their ids, in every array with one for each id\n"),
        "{}",
        text(&out.stdout)
    );

    // Of some rows: the others are named, and a difference has its place in the first file.
    write("c.npz", &["r4", "r9", "r2"], &|at| {
        at as f32 + f32::from(at == 10 * usize::from(b'4') + 2)
    });
    let report = files.json("a.npz", "c.npz", &[]);
    assert_eq!((&report["paired_rows"], &report["paired_by"]), (&json!(2), &json!("id")));
    assert_eq!((&report["only_a"], &report["only_b"]), (&json!(["r1", "r3"]), &json!(["r9"])));
    let features = report["features"].as_array().unwrap();
    let x = features.iter().find(|f| f["feature"] == "X").unwrap();
    assert_eq!((&x["values"], &x["equal"]), (&json!(10), &json!(9)));
    assert_eq!(x["largest"]["index"], json!([3, 2]));
    let texts = report["texts"].as_array().unwrap();
    assert!(texts.iter().all(|t| t["values"] == 2 && t["differing"] == 0), "{report:#}");

    // The same ids in the same order need no word; without a common one, numbers count, and that is said.
    assert_eq!(files.json("a.npz", "a.npz", &[])["paired_rows"], Value::Null);
    write("d.npz", &["s1", "s2", "s3", "s4"], &same);
    let out = files.run("a.npz", "d.npz", &[]);
    assert_eq!(out.status.code(), Some(1), "the ids differ");
    assert!(text(&out.stdout).contains("no id in common: rows are paired by number"));
    // By file name as our own, and not at all by ids that come twice.
    write("e.npz", &["x/r2", "x/r1", "x/r4", "x/r3"], &same);
    let report = files.json("a.npz", "e.npz", &[]);
    assert_eq!((&report["paired_rows"], &report["paired_by"]), (&json!(4), &json!("file_name")));
    assert!(report["features"].as_array().unwrap().iter().all(|f| f["differing"] == 0));
    write("f.npz", &["r1", "r1", "r3", "r4"], &same);
    assert_eq!(files.json("a.npz", "f.npz", &[])["paired_rows"], Value::Null);
}
