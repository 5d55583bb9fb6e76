//! Label files beside predictions.

use serde_json::Value;

use crate::command::{done, refused, run, text, written};

#[test]
fn labels_come_from_a_file_with_any_key_column() {
    let folder = tempfile::tempdir().unwrap();
    let (file, labels) = (folder.path().join("p.csv"), folder.path().join("meta.csv"));
    std::fs::write(&file, "id,path,predicted,p_a,p_b\nx,d/x.ogg,a,1,0\ny,d/y.ogg,b,0,1\n").unwrap();
    std::fs::write(&labels, "file,fold,category\ny.ogg,2,b\nx.ogg,1,b\n").unwrap();
    let by = ["--labels", text(&labels), "--id-column", "file", "--target", "category", "--json"];
    let report = done(&[&["score", text(&file)], &by[..]].concat());
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["scores"]["accuracy"], 0.5);
    let without = refused(&["score", text(&file)]);
    assert!(without.contains("--labels") && without.contains("--target"), "{without}");
    let unnamed = refused(&["score", text(&file), "--labels", text(&labels)]);
    assert!(unnamed.contains("--id-column"), "{unnamed}");
    // Container and sequence are one name.
    std::fs::write(&file, "container,sequence,predicted\n1,1,a\n1,2,b\n").unwrap();
    std::fs::write(&labels, "id,class\n1/2,b\n1/1,b\n").unwrap();
    let report = done(&["score", text(&file), "--labels", text(&labels), "--json"]);
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["scores"]["accuracy"], 0.5);
}

/// The labels of a whole data set serve a part of it, whose size they tell.
#[test]
fn labels_without_recordings_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let labels = put("all.csv", "id,class\na,x\nb,y\nc,x\nd,y\n");
    let numbers = put("numbers.csv", "id,n\na,1.5\nb,2.5\nc,1.5\nd,2.5\n");
    let file = put("p.csv", "id,predicted\na,x\nb,y\n");
    let estimates = put("e.csv", "id,predicted\na,1.5\nb,2.5\nc,1\n");
    for (file, labels, told) in
        [(&file, &labels, "2 lines of "), (&estimates, &numbers, "line 5 of ")]
    {
        let scored = run(&["score", text(file), "--labels", text(labels)]);
        let said = String::from_utf8(scored.stderr).unwrap();
        assert!(scored.status.success() && said.contains(told), "{said}");
        assert!(said.contains("no recording here") && said.lines().count() == 1, "{said}");
    }
    let compare = ["compare-predictions", text(&file), text(&file), "--labels", text(&labels)];
    let said = String::from_utf8(run(&compare).stderr).unwrap();
    assert!(said.contains("such as line 4, \"c\""), "{said}");
    let fewer = put("fewer.csv", "id,class\na,x\nB,y\n");
    let said = refused(&["score", text(&file), "--labels", text(&fewer)]);
    let both = ["no line for recording \"b\"", "line 3 of ", ", \"B\", has no recording here"];
    assert!(both.iter().all(|part| said.contains(part)), "{said}");
}

/// A corrected label file had no effect beside a column `true` of the predictions.
#[test]
fn the_only_label_column_has_the_true_classes() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let file = put("p.csv", "id,true,predicted\na,x,x\nb,y,y\n");
    let accuracy = |labels: &std::path::Path, more: &[&str]| {
        let score = ["score", text(&file), "--labels", text(labels), "--json"];
        let report: Value = serde_json::from_str(&done(&[&score[..], more].concat())).unwrap();
        report["scores"]["accuracy"].as_f64().unwrap()
    };
    let one = put("one.csv", "id,class\na,y\nb,x\n");
    assert_eq!(accuracy(&one, &[]), 0.0);
    assert_eq!(accuracy(&one, &["--target", "true"]), 1.0);
    let group = put("group.csv", "id,site\na,1\nb,2\n");
    assert_eq!(accuracy(&group, &["--groups", "site"]), 1.0);
    // The classes themselves were drawn as groups.
    let of = put("of.csv", "id,container,predicted\na,1,1\nb,2,2\nc,1,1\nd,2,1\n");
    let scored = done(&["score", text(&of), "--target", "container", "--json"]);
    let scored: Value = serde_json::from_str(&scored).unwrap();
    assert_eq!(scored["drawn"], "rows", "{scored}");
    let two = put("two.csv", "id,site,class\na,1,y\nb,2,x\n");
    let score = ["score", text(&file), "--labels", text(&two)];
    let message = refused(&score);
    assert!(
        message.contains("the labels have site, class: --target names the column"),
        "{message}"
    );
    let compare = ["compare-predictions", text(&file), text(&file), "--labels"];
    assert!(refused(&[&compare[..], &[text(&two)]].concat()).contains("--target"));
    let compared = done(&[&compare[..], &[text(&one), "--json"]].concat());
    let compared: Value = serde_json::from_str(&compared).unwrap();
    assert_eq!(compared["first"]["scores"]["accuracy"], 0.0);
}
