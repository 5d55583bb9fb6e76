//! `score` and `classifiers` as a user runs them.

use serde_json::Value;

use crate::command::{done, refused, run, text, written};

/// Values of scikit-learn 1.9: accuracy_score, f1_score, brier_score_loss, roc_auc_score(ovr),
/// average_precision_score of these six rows.
const HELD_OUT: &str = "id,group,true,predicted,p_a,p_b,p_c\n\
    1,g,a,a,0.7,0.2,0.1\n2,g,b,a,0.5,0.4,0.1\n3,g,c,c,0.1,0.1,0.8\n\
    4,h,a,b,0.3,0.6,0.1\n5,h,b,b,0.2,0.7,0.1\n6,h,c,c,0.2,0.2,0.6\n";

#[test]
fn predictions_are_scored() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.csv");
    std::fs::write(&file, HELD_OUT).unwrap();
    let report = done(&["score", text(&file), "--json", "--resamples", "200"]);
    let report: Value = serde_json::from_str(&report).unwrap();
    let close = |value: &Value, expected: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - expected).abs() < 1e-12, "{value} and {expected}");
    };
    close(&report["scores"]["accuracy"], 4.0 / 6.0);
    close(&report["scores"]["weighted_f1"], 2.0 / 3.0);
    close(&report["calibration"]["brier"], 2.06 / 6.0);
    close(&report["roc_auc"], (0.875 + 0.875 + 1.0) / 3.0);
    assert_eq!((&report["drawn"], &report["units"]), (&"group".into(), &2.into()));
    assert_eq!(report["unknown"], 0);
    // The tip was to give -0.1 as a file.
    let negative = refused(&["score", text(&file), "--reject", "-0.1"]);
    assert!(negative.contains("0 to 1") && !negative.contains("unexpected"), "{negative}");
    let rejected = done(&["score", text(&file), "--json", "--reject", "0.65"]);
    let rejected: Value = serde_json::from_str(&rejected).unwrap();
    assert_eq!(rejected["unknown"], 3);
    close(&rejected["scores"]["accuracy"], 0.5);
    close(&rejected["accuracy_of_known"], 1.0);
    let shown = done(&["score", text(&file), "--reject", "0.65"]);
    for part in [
        "3 without a prediction count as wrong",
        "bootstrap over 2 groups (column group)",
        "unknown",
    ] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
}

#[test]
fn numbers_have_scores_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.csv");
    std::fs::write(&file, "id,true,predicted\n1,100.5,100.5\n2,200,300\n3,50,-1\n").unwrap();
    let report: Value = serde_json::from_str(&done(&["score", text(&file), "--json"])).unwrap();
    assert_eq!((&report["kind"], &report["unknown"]), (&"numbers".into(), &1.into()));
    let score = report["score"].as_f64().unwrap();
    assert!((score - (1.0 + (-0.5f64).exp()) / 3.0).abs() < 1e-12, "{score}");
    assert!(done(&["score", text(&file)]).contains("CORSMAL score"));
}

/// Estimates had an accuracy of 0.
#[test]
fn numbers_are_not_compared_as_classes() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("numbers.csv");
    std::fs::write(&file, "id,true,predicted\na,1,1.5\nb,2,2\n").unwrap();
    let message = refused(&["compare-predictions", text(&file), text(&file)]);
    assert!(message.contains("score --numeric"), "{message}");
}

/// They made a class without a name, which lowered macro F1.
#[test]
fn lines_without_a_prediction_are_compared_as_score_counts_them() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let one = put("1.csv", "id,true,predicted\n1,x,x\n2,y,y\n3,x,y\n4,y,y\n5,x,x\n");
    let two = put("2.csv", "id,true,predicted\n5,x,y\n1,x,y\n2,y,y\n3,x,x\n4,y,\n");
    let compared = done(&["compare-predictions", text(&one), text(&two), "--json"]);
    let compared: Value = serde_json::from_str(&compared).unwrap();
    assert_eq!(compared["labels"], serde_json::json!(["x", "y"]));
    let scored = done(&["score", text(&two), "--json"]);
    let scored: Value = serde_json::from_str(&scored).unwrap();
    for what in ["accuracy", "weighted_f1", "macro_f1", "classes", "confusion", "unknown"] {
        assert_eq!(compared["second"]["scores"][what], scored["scores"][what], "{what}");
    }
    assert_eq!(scored["scores"]["unknown"], serde_json::json!([0, 1]));
    assert_eq!(compared["mcnemar"]["only_first"], 3);
}

/// Windows counted as independent recordings.
#[test]
fn windows_of_a_recording_are_drawn_together() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let table = |wrong: std::ops::Range<usize>, column: &str| {
        let line = |row: usize| {
            let predicted = if wrong.contains(&(row / 10)) { "y" } else { "x" };
            format!("{row},{},x,{predicted}\n", row / 10)
        };
        format!("id,{column},true,predicted\n{}", (0..120).map(line).collect::<String>())
    };
    let (one, two) =
        (put("1.csv", &table(0..3, "recording")), put("2.csv", &table(3..4, "recording")));
    let compare = ["compare-predictions", text(&one), text(&two)];
    let output = run(&compare);
    let (shown, told) = [&output.stdout, &output.stderr].map(|b| String::from_utf8_lossy(b)).into();
    assert!(
        shown.contains("over rows") && shown.contains("over 12 groups (column recording)"),
        "{shown}"
    );
    assert!(told.contains("rows of one recording are not independent"), "{told}");
    let report = done(&[&compare[..], &["--json"]].concat());
    let report: Value = serde_json::from_str(&report).unwrap();
    assert!(report["bootstrap_rows"]["low"].as_f64().unwrap() > 0.0, "{report}");
    assert!(report["bootstrap_groups"]["low"].as_f64().unwrap() < 0.0, "{report}");
    let (one, two) = (put("1.csv", &table(0..3, "place")), put("2.csv", &table(3..4, "place")));
    let compare = ["compare-predictions", text(&one), text(&two)];
    assert!(done(&compare).contains("over recordings"));
    // Groups of either file count, those of one row do not.
    let named = put("3.csv", &table(0..3, "recording"));
    for files in [[&named, &two], [&two, &named]] {
        let output = run(&["compare-predictions", text(files[0]), text(files[1])]);
        let shown = String::from_utf8_lossy(&output.stdout);
        assert!(shown.contains("over 12 groups (column recording)"), "{shown}");
    }
    let lines: String = (0..12).map(|row| format!("{row},{row},x,x\n")).collect();
    let alone = put("4.csv", &format!("id,recording,true,predicted\n{lines}"));
    assert!(done(&["compare-predictions", text(&alone), text(&alone)]).contains("over recordings"));
    assert!(
        done(&[&compare[..], &["--groups", "place"]].concat()).contains("12 groups (column place)")
    );
    // They were left out without a word.
    let output = run(&[&compare[..], &["--groups", "true"]].concat());
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("no groups are drawn by \"true\": it has a single value"), "{told}");
}

/// The first file's were taken: the order of the files decided what is significant.
#[test]
fn files_that_disagree_about_groups_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let table = |size: usize, missing: usize| {
        let group =
            |row: usize| if row < missing { String::new() } else { (row / size).to_string() };
        let lines = (0..60).map(|row| format!("{row},{},x,x\n", group(row)));
        format!("id,group,true,predicted\n{}", lines.collect::<String>())
    };
    let (one, two) = (put("1.csv", &table(4, 0)), put("2.csv", &table(5, 0)));
    for files in [[&one, &two], [&two, &one]] {
        let found = refused(&["compare-predictions", text(files[0]), text(files[1])]);
        assert!(found.contains("is of group \"") && found.contains("name other groups"), "{found}");
    }
    // Each row its own group: nothing to draw, but no less a contradiction.
    let alone = put("3.csv", &table(1, 0));
    for files in [[&one, &alone], [&alone, &one]] {
        refused(&["compare-predictions", text(files[0]), text(files[1])]);
    }
    // Missing cells, other names of the same groups, a column that only one file has.
    let some = put("4.csv", &table(4, 8));
    let renamed = put("5.csv", &table(4, 8).replace(",x,x", ".0,x,x").replace(",.0,", ",,"));
    let places = table(10, 0).replace("group", "container");
    let placed = put("6.csv", &places);
    for (other, expected) in [(&some, 15), (&renamed, 15), (&placed, 15)] {
        for files in [[&one, other], [other, &one]] {
            let found = done(&["compare-predictions", text(files[0]), text(files[1])]);
            assert!(found.contains(&format!("{expected} groups (column group)")), "{found}");
        }
    }
    // Without its own name, row 1 would join group b of the first file.
    let named = put("7.csv", "id,group,true,predicted\n0,b,x,x\n1,,x,x\n2,c,x,x\n");
    let other = put("8.csv", "id,group,true,predicted\n0,a,x,x\n1,b,x,x\n2,c,x,x\n");
    let found = refused(&["compare-predictions", text(&named), text(&other)]);
    assert!(found.contains("is the name of another one here"), "{found}");
}

/// 1e-36 from 2,000 draws, and the same from one.
#[test]
fn draws_that_agree_bound_the_p_value() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let table = |right: usize| {
        let line = |row: usize| format!("{row},x,{}\n", if row < right { "x" } else { "y" });
        format!("id,true,predicted\n{}", (0..120).map(line).collect::<String>())
    };
    let (one, two) = (put("1.csv", &table(20)), put("2.csv", &table(110)));
    let compare = ["compare-predictions", text(&one), text(&two)];
    let report: Value = serde_json::from_str(&done(&[&compare[..], &["--json"]].concat())).unwrap();
    assert_eq!(report["bootstrap_rows"]["p_value"], 2.0 / 2001.0);
    assert!(done(&compare).contains("; p < 0.001"));
}

/// As pandas writes whole numbers beside empty cells: every row was wrong.
#[test]
fn numbers_that_are_spelled_otherwise_are_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let one = put("1.csv", "id,true,predicted\na,1,1\nb,2,2\nc,1,1\n");
    let two = put("2.csv", "id,true,predicted\na,1,1.0\nb,2,2.0\nc,1,1.0\n");
    for files in [[&one, &two], [&two, &one]] {
        let found = refused(&["compare-predictions", text(files[0]), text(files[1])]);
        assert!(found.contains("are the same number: spell both alike, or score them"), "{found}");
    }
    let one = put("1.csv", "id,true,predicted\na,Dog,Dog\nb,cat,cat\n");
    let two = put("2.csv", "id,true,predicted\na,Dog,dog\nb,cat,cat\n");
    let output = run(&["compare-predictions", text(&one), text(&two)]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("\"Dog\" and \"dog\" differ only in how they are written"), "{told}");
}

/// Label columns of these names hid the ids.
#[test]
fn ids_name_recordings_before_container_and_sequence_do() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let one = put("1.csv", "id,container,sequence,true,predicted\na,1,1,c,c\nb,1,1,d,c\n");
    let two = put("2.csv", "id,container,sequence,true,predicted\nb,1,1,d,d\na,1,1,c,d\n");
    assert!(done(&["score", text(&one)]).contains("2 rows"));
    let compared = done(&["compare-predictions", text(&one), text(&two), "--json"]);
    let compared: Value = serde_json::from_str(&compared).unwrap();
    assert_eq!((&compared["mcnemar"]["only_first"], &compared["rows"]), (&1.into(), &2.into()));
    // Without ids they name a recording together.
    let published = put("m5.csv", "Object,Sequence,true,p0,p1\n10,0,0,1,0\n10,1,1,0,1\n");
    assert!(done(&["score", text(&published)]).contains("2 rows"));
}

#[test]
fn doubtful_scores_are_refused_or_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.csv");
    let warned = |table: &str| {
        std::fs::write(&file, table).unwrap();
        let output = run(&["score", text(&file)]);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let exchanged = warned("id,true,predicted,p_x,p_y\na,x,x,0.1,0.9\nb,y,y,0.8,0.2\n");
    assert!(
        exchanged.contains("warning: ") && exchanged.contains("in another order"),
        "{exchanged}"
    );
    let decimal = warned("id,true,predicted\na,1.0,1.0\nb,2.0,1.0\n");
    assert!(decimal.contains("note: ") && decimal.contains("scored as numbers"), "{decimal}");
    std::fs::write(&file, "id,true,predicted\na,1,1.0\nb,2,2.0\n").unwrap();
    assert!(refused(&["score", text(&file)]).contains("are the same number"));
    assert!(done(&["score", text(&file), "--numeric"]).contains("mean absolute error"));
    std::fs::write(&file, "{\"id\":\"a\",\"predicted\":\"x\"}\n").unwrap();
    let json = refused(&["score", text(&file), "--labels", "folders"]);
    assert!(json.contains("is JSON, but prediction files are read as CSV"), "{json}");
}

#[test]
fn classifiers_are_explained() {
    let list = done(&["classifiers"]);
    assert!(list.contains("rf         random forest"), "{list}");
    let shown = done(&["classifiers", "rf"]);
    for part in ["trees", "100", "number of trees", "n_estimators", "max_features", "sqrt"] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
    let json: Value = serde_json::from_str(&done(&["classifiers", "svm", "--json"])).unwrap();
    assert_eq!(json["parameters"][0]["default"], 1.0);
    let wrong = refused(&["classifiers", "random-forest"]);
    assert!(wrong.contains("there is no classifier"), "{wrong}");
}

#[test]
fn the_help_is_in_groups_and_says_where_to_start() {
    let output = run(&["--help"]);
    let help = String::from_utf8(output.stdout).unwrap();
    assert!(help.starts_with("start: corsmal-feat demo\n"), "{help}");
    for heading in ["Features:", "Models:", "Files:", "CORSMAL:", "Exit codes:"] {
        assert!(help.contains(heading), "{heading}: {help}");
    }
    assert!(!help.contains("Other:"), "every command has a group: {help}");
}

#[test]
fn what_is_explained_is_explained_to_programs_too() {
    let json = |arguments: &[&str]| -> Value {
        serde_json::from_str(&done(&[arguments, &["--json"]].concat())).unwrap()
    };
    let mfcc = json(&["features", "mfcc"]);
    assert_eq!(mfcc["python"], "feature.mfcc");
    let keys = mfcc["keys"].as_array().unwrap();
    let n_mfcc = keys.iter().find(|key| key["key"] == "n_mfcc").unwrap();
    assert_eq!(n_mfcc["default"], 20);
    assert!(json(&["features"]).as_array().unwrap().contains(&mfcc));
    let esc26 = json(&["presets", "esc26"]);
    assert_eq!(esc26["config"]["signal"]["sample_rate"], 22_050.0);
    assert!(json(&["presets"]).as_array().unwrap().contains(&esc26));
}

/// The first of two columns counted, whatever the other said.
#[test]
fn tables_with_two_columns_of_one_name_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.csv");
    for header in ["id,true,true,predicted", "id,true,True,predicted", "id,predicted,x,predicted"] {
        std::fs::write(&file, format!("{header}\nr,a,a,a\ns,b,b,b\n")).unwrap();
        assert!(refused(&["score", text(&file)]).contains("two columns are named"), "{header}");
    }
    std::fs::write(&file, "fileName,capacity[mL],Capacity[mL]\nid1_0000.png,100,200\n").unwrap();
    let out = folder.path().join("c.csv");
    let combine = ["capacity", "combine", "--in", text(&file), "--out", text(&out)];
    let message = refused(&[&combine[..], &["--prior=-5"]].concat());
    assert!(message.contains("of at least 0, or -1 for none"), "{message}");
    assert!(refused(&combine).contains("two columns are named"));
}

/// A confusion matrix of ids has billions of places.
#[test]
fn ids_are_no_classes() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.csv");
    let write = |classes: usize| {
        let rows: String = (0..classes).map(|i| format!("r{i},{i},{i}\n")).collect();
        std::fs::write(&file, format!("id,true,predicted\n{rows}")).unwrap();
    };
    write(100_000);
    let message = refused(&["score", text(&file)]);
    assert!(message.contains("100000 different classes, but at most 4096"), "{message}");
    // Two thousand draws of so many took minutes.
    write(2000);
    assert!(done(&["score", text(&file)]).contains("2000 rows, 2000 classes"));
    let numbers = done(&["score", text(&file), "--numeric", "--json"]);
    assert!(numbers.contains("\"numbers\""), "{numbers:.200}");
}

/// The message named the predictions alone, which were right.
#[test]
fn a_bad_number_is_said_to_be_true_or_an_estimate() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.csv");
    for (row, words) in [("a,1e,2", "a: the true value"), ("a,2,1e", "a: the estimate")] {
        std::fs::write(&file, format!("id,true,predicted\n{row}\nb,3,3\n")).unwrap();
        let message = refused(&["score", text(&file), "--numeric"]);
        assert!(message.contains(&format!("{words} \"1e\" is not a number")), "{message}");
    }
    std::fs::write(&file, "id,true,predicted\na,1,-1\nb,3,-1\n").unwrap();
    let message = refused(&["score", text(&file), "--numeric"]);
    assert!(message.contains("no row has an estimate (-1 stands for none)"), "{message}");
}

/// One class that is called like a decimal number made numbers of all.
#[test]
fn a_class_may_be_called_like_a_number() {
    let folder = tempfile::tempdir().unwrap();
    let lines = "id,true,predicted\n1,dog,dog\n2,1e5,1e5\n3,cat,dog\n";
    let file = written(folder.path(), "p.csv", lines);
    let report = done(&["score", text(&file), "--json", "--resamples", "50"]);
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["kind"], "classes");
    // A number that is misspelt is still said.
    let lines = "id,true,predicted\n1,1.5,1.4\n2,2.5x,2.5\n3,0.5,0.5\n";
    let file = written(folder.path(), "n.csv", lines);
    assert!(
        refused(&["score", text(&file)]).contains("2: the true value \"2.5x\" is not a number")
    );
    let lines = "id,true,predicted\n1,1.5,1.4\n2,2.5,n/a\n3,0.5,0.5\n";
    let file = written(folder.path(), "e.csv", lines);
    assert!(refused(&["score", text(&file)]).contains("2: the estimate \"n/a\" is not a number"));
}

/// `fuse` took the probabilities of predictions that `classify --reject` had withheld.
#[test]
fn rejected_predictions_stay_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let lines = "id,path,predicted,p_a,p_b\n1,1.wav,unknown,0.6,0.4\n2,2.wav,b,0.1,0.9\n";
    let file = written(folder.path(), "p.csv", lines);
    let fused = run(&["fuse", text(&file), text(&file), "-o", "-"]);
    assert_eq!(fused.status.code(), Some(1));
    let fused = String::from_utf8(fused.stdout).unwrap();
    let predicted: Vec<&str> =
        fused.lines().skip(1).map(|line| line.split(',').nth(2).unwrap_or_default()).collect();
    assert_eq!(predicted, ["", "b"], "{fused}");
}
