//! `fuse` and `compare-predictions` as a user runs them.

use std::path::Path;

use serde_json::Value;

use crate::command::{done, refused, run, shared, text, written};

/// The command of docs/ccm.md: type, level and capacity of every row are M5's.
#[test]
fn the_winning_submission_is_rebuilt() {
    let Some(dir) = shared("data/ccm/m5_predictions") else { return };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("m5.csv");
    let file = |name: &str| dir.join(name).to_str().unwrap().to_string();
    let types = [file("publictest_type_rf.csv"), file("publictest_type_vggish_agg.csv")];
    let levels =
        ["rf", "vggish_agg", "r21d_agg"].map(|n| file(&format!("publictest_level_{n}.csv")));
    let capacity = file("capacity_estimation_combination_public_test.csv");
    let [t1, t2] = types.each_ref().map(String::as_str);
    let [l1, l2, l3] = levels.each_ref().map(String::as_str);
    done(&[
        "fuse",
        "--type",
        t1,
        t2,
        "--level",
        l1,
        l2,
        l3,
        "--capacity",
        &capacity,
        "--format",
        "2020",
        "--part",
        "public",
        "--out",
        text(&out),
    ]);
    let rows = |path: &Path| -> Vec<Vec<f64>> {
        let table = std::fs::read_to_string(path).unwrap();
        let cells = |line: &str| line.split(',').map(|c| c.parse().unwrap()).collect();
        table.lines().skip(1).map(cells).collect()
    };
    let (ours, published) = (rows(&out), rows(&dir.join("submission_public_test.csv")));
    assert_eq!(ours.len(), 228);
    for (ours, published) in ours.iter().zip(&published) {
        assert_eq!(ours[..4], published[..4]);
        // Their mean of two capacities was rounded on its way through another file.
        assert!((ours[4] - published[4]).abs() < 1e-9);
    }
    // Deciding both together leaves no infeasible pair.
    done(&[
        "fuse",
        "--type",
        t1,
        t2,
        "--level",
        l1,
        l2,
        l3,
        "--feasible",
        "--dry-boxes",
        "--format",
        "2020",
        "--out",
        text(&out),
        "--overwrite",
    ]);
    for row in rows(&out) {
        assert_eq!(row[2] == 0.0, row[3] == 0.0, "{row:?}");
        assert!(!(row[0] == 12.0 && row[2] == 3.0), "{row:?}");
    }
}

#[test]
fn submissions_are_checked_before_they_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let put = |name: &str, lines: &str| std::fs::write(at(name), lines).unwrap();
    put(
        "type.csv",
        "id,path,predicted,p_none,p_pasta,p_rice,p_water\n\
        000000,a/000000.wav,none,1,0,0,0\n000001,a/000001.wav,rice,0.1,0.2,0.6,0.1\n",
    );
    put(
        "level.csv",
        "id,path,predicted,p_empty,p_half,p_full\n\
        000001,a/000001.wav,full,0.1,0.2,0.7\n000000,a/000000.wav,,,,\n",
    );
    // Ids of two parts: which are meant?
    put(
        "parts.csv",
        "fileName,capacity[mL],part\nid000000.png,100,public test\n\
        id000001.png,101,public test\nid000000.png,200,private test\n",
    );
    let parts = at("parts.csv");
    let (kind, level, out) = (at("type.csv"), at("level.csv"), at("s.csv"));
    let fuse = ["fuse", "--type", text(&kind), "--level", text(&level), "--out", text(&out)];
    let output = run(&[&fuse[..], &["--format", "2022"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = std::fs::read_to_string(&out).unwrap();
    let lines: Vec<_> = table.lines().collect();
    let zero = "0,-1,-1,-1,1.000000,0.000000,0.000000,0.000000,0,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1";
    assert_eq!(lines[1], zero);
    assert!(lines[2].starts_with("1,-1,-1,-1,0.100000,0.200000,0.600000,0.100000,2,0.100000"));
    std::fs::remove_file(&out).unwrap();
    // Levels were taken for types in silence.
    put("numbers.csv", "Object,Sequence,p0,p1,p2\n1,0,0.5,0.4,0.1\n1,1,0.2,0.4,0.4\n");
    let numbers = at("numbers.csv");
    let to = ["--format", "2020", "--out", text(&out)];
    let said = |task| {
        let output = run(&[&["fuse", task, text(&numbers)], &to[..]].concat());
        std::fs::remove_file(&out).unwrap();
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(said("--type").contains("is this a table of levels?"));
    assert!(!said("--level").contains("table of levels"));
    for (extra, message) in [
        (&["--format", "2020"][..], "id 0 does not fit this format"),
        (&["--format", "2022", "--part", "public"], "missing rows: id 2"),
        (&["--format", "2022", "--capacity", text(&kind)], "no column 'fileName'"),
        (&["--format", "2022", "--capacity", text(&parts)], "id 0 in several parts"),
        (
            &["--format", "2022", "--capacity", text(&parts), "--part", "public"],
            "missing rows: id 2",
        ),
        (
            &["--format", "2022", "--capacity", text(&parts), "--part", "private"],
            "has no line for id 1",
        ),
        (&["--format", "2022", "--annotations", text(&kind)], "type.csv"),
        (&["--type-weights", "1,2"], "weights: expected 1, found 2"),
        (&["--type-weights=-1"], "positive"),
        (&["--joint", text(&kind)], "--joint"),
        (&["--vote", "majority", "--background", "tea"], "tea"),
        (
            &["--vote", "majority", "--background", "none", "--feasible"],
            "--background works on the windows of one file: it cannot be combined with --feasible",
        ),
        (&["--vote", "majority", "--background", "none", "--least", "0"], "--least"),
    ] {
        let found = refused(&[&fuse[..], extra].concat());
        assert!(found.contains(message), "{found}");
        assert!(!out.exists());
    }
    let generic = ["fuse", "--predictions", text(&kind), text(&level), "--out", text(&out)];
    assert!(refused(&generic).contains("has the classes empty, half, full"));
    let misused = ["fuse", "--predictions", text(&kind), "--feasible", "--out", text(&out)];
    assert!(refused(&misused).contains("--feasible is for submissions"));
    assert!(refused(&["fuse", "--out", text(&out)]).contains("nothing to fuse"));
    // A vote with a background is not averaged: its decision would be lost.
    let vote = ["--vote", "majority", "--background", "none"];
    for files in [&[text(&kind), text(&kind)][..], &[text(&kind), "--weights", "2"]] {
        let fuse = ["fuse", "--out", text(&out), "--predictions"];
        let found = refused(&[&fuse[..], files, &vote].concat());
        assert!(found.contains("cannot be combined with an average of files"), "{found}");
    }
    for (lines, message) in [
        ("id,p_none,p_rice\nx,5,3\n", "line 2, column 'p_none': '5' is not a probability"),
        ("id,p_none,p_rice\nx,0.5,0.6\n", "line 2: the probabilities add up to 1.1, not 1"),
        ("id,p_none,p_rice\nx,0,1\nx,1,0\n", "more than one row: id x"),
    ] {
        put("one.csv", lines);
        let one = at("one.csv");
        let found = refused(&["fuse", "--predictions", text(&one), "--out", text(&out)]);
        assert!(found.contains(message), "{found}");
    }
    put("far.csv", "Object,Sequence,p0,p1\n99,0,1,0\n");
    let far = at("far.csv");
    let found = refused(&["fuse", "--type", text(&far), "--out", text(&out)]);
    assert!(found.contains("no container of the data set: 99"), "{found}");
    put("odd.csv", "id,predicted,p_none,p_rice\nx,tea,1,0\n");
    let odd = at("odd.csv");
    let odd = ["fuse", "--predictions", text(&odd), "--out", text(&out)];
    assert!(refused(&odd).contains("line 2, column 'predicted': 'tea'"));
    assert!(!out.exists());
}

#[test]
fn prediction_files_are_averaged_by_id() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.csv"), folder.path().join("b.csv"));
    std::fs::write(
        &a,
        "id,path,status,predicted,p_x,p_y\nr,r.wav,ok,x,0.75,0.25\ns,s.wav,ok,y,0,1\n",
    )
    .unwrap();
    std::fs::write(
        &b,
        "id,path,status,predicted,p_x,p_y\ns,s.wav,corrupt,,,\nr,r.wav,ok,y,0.25,0.75\n",
    )
    .unwrap();
    let fuse = ["fuse", "--out", "-", "--weights", "1,3", "--predictions", text(&a), text(&b)];
    let output = run(&fuse);
    assert_eq!(output.status.code(), Some(1), "one recording has no prediction");
    let table = String::from_utf8(output.stdout).unwrap();
    assert_eq!(
        table,
        "id,path,status,predicted,p_x,p_y\nr,r.wav,ok,y,0.375,0.625\ns,s.wav,corrupt,,,\n"
    );
}

/// Labels called `p0` and `p1` were taken for the probabilities.
#[test]
fn labels_that_look_like_probabilities_stay_labels() {
    let folder = tempfile::tempdir().unwrap();
    let header = "id,path,status,true,p0,p1,predicted,p_0,p_1\n";
    let rows = "a,a.wav,ok,0,0.9,0.1,0,0.75,0.25\nb,b.wav,ok,1,0.9,0.1,1,0.25,0.75\n";
    let file = written(folder.path(), "p.csv", &format!("{header}{rows}"));
    let score: Value = serde_json::from_str(&done(&["score", text(&file), "--json"])).unwrap();
    assert_eq!(score["calibration"]["brier"], 0.0625, "{score}");
    let fused = done(&["fuse", text(&file), text(&file), "-o", "-"]);
    assert_eq!(fused, format!("{header}{rows}"));
}

/// One of them made a recording of every window.
#[test]
fn windows_without_features_belong_to_their_recording() {
    let folder = tempfile::tempdir().unwrap();
    let windows = "id,path,status,recording,predicted,p_x,p_y\nn@0,n.wav,ok,n,x,1,0\n\
                   n@0.5,n.wav,non_finite,,,,\no@0,o.wav,ok,o,y,0,1\no@0.5,o.wav,ok,o,y,0,1\n";
    let file = written(folder.path(), "w.csv", windows);
    let voted = run(&["fuse", text(&file), "--vote", "majority", "-o", "-"]);
    let table = String::from_utf8(voted.stdout).unwrap();
    let ids: Vec<_> = table.lines().filter_map(|line| line.split(',').next()).collect();
    assert_eq!(ids, ["id", "n", "o"], "{table}");
}

/// A recording that lacked samples looked whole.
#[test]
fn the_worst_status_stays() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let windows = put(
        "w.csv",
        "id,start,end,status,predicted,p_x,p_y\na,0,1,ok,x,0.75,0.25\na,1,2,truncated,y,0.25,0.75\n\
         a,2,3,ok,x,0.75,0.25\nb,0,1,ok,x,1,0\nb,1,2,ok,x,1,0\nc,0,1,truncated,x,1,0\nc,1,2,too_short,,,\n",
    );
    let vote = ["fuse", text(&windows), "--vote", "majority", "-o"];
    let voted = folder.path().join("voted.csv");
    done(&[&vote[..], &[text(&voted)]].concat());
    let table = std::fs::read_to_string(&voted).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines[0], "id,status,predicted,p_x,p_y");
    for (line, begins) in lines[1..].iter().zip(["a,truncated,x,", "b,ok,x,", "c,too_short,x,"]) {
        assert!(line.starts_with(begins), "{table}");
    }
    // Of files, too, whichever comes first and whether or not the others say any.
    let bare = put("bare.csv", "id,predicted,p_x,p_y\na,x,1,0\nb,x,1,0\nc,x,1,0\n");
    let other =
        put("o.csv", "id,status,predicted,p_x,p_y\na,ok,x,1,0\nb,truncated,x,1,0\nc,ok,x,1,0\n");
    for files in [[&bare, &other, &voted], [&voted, &bare, &other]] {
        let files = files.map(|path| text(path));
        let fused = done(&[&["fuse", "-o", "-"], &files[..]].concat());
        let of = |id: &str| fused.lines().find(|line| line.starts_with(id)).unwrap().to_owned();
        assert!(of("a,").starts_with("a,truncated,x,"), "{fused}");
        assert!(of("b,").starts_with("b,truncated,x,"), "{fused}");
        assert!(of("c,").starts_with("c,too_short,x,"), "{fused}");
    }
    assert!(done(&["fuse", text(&other), "-o", "-"]).contains("\nb,truncated,x,"));
}

/// The first file, or window, had the last word.
#[test]
fn contradictions_and_repeated_windows_are_not_fused() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| written(folder.path(), name, text);
    let head = "id,fold,true,predicted,p_x,p_y\n";
    let one = put("1.csv", &format!("{head}a,1,x,x,0.9,0.1\nb,2,y,y,0.2,0.8\n"));
    for (other, message) in [
        ("a,1,y,x,0.9,0.1\nb,2,y,y,0.2,0.8\n", "id a: true is y here and x in"),
        ("a,1,x,x,0.9,0.1\nb,1,y,y,0.2,0.8\n", "id b: fold is 1 here and 2 in"),
        ("a,1,x,x,,\nb,2,y,y,0.2,0.8\n", "id a: is predicted without probabilities"),
    ] {
        let two = put("2.csv", &format!("{head}{other}"));
        let found = refused(&["fuse", text(&one), text(&two), "-o", "-"]);
        assert!(found.contains(message), "{found}");
    }
    let unlabelled = put("2.csv", "id,predicted,p_x,p_y\na,x,0.9,0.1\nb,y,0.2,0.8\n");
    assert!(done(&["fuse", text(&one), text(&unlabelled), "-o", "-"]).contains("a,1,x,x,"));
    for (windows, message) in [
        ("id,start,end,predicted\na,0,1,x\na,1,2,y\na,1,2,y\n", "one window of id a, start \"1\""),
        ("id,start,true,predicted\na,0,x,x\na,1,y,y\n", "true is x in one window and y in another"),
        (
            "id,start,true,predicted\na,0,,x\na,1,x,x\na,2,y,y\n",
            "true is x in one window and y in another",
        ),
        ("id,recording,predicted\na@0-1,a,x\na@0-1,a,x\n", "more than one row: id a@0-1"),
    ] {
        let windows = put("w.csv", windows);
        let found = refused(&["fuse", text(&windows), "--vote", "majority", "-o", "-"]);
        assert!(found.contains(message), "{found}");
    }
    // What one file or window leaves empty, another one says.
    let empty = put("2.csv", &format!("{head}a,1,,x,0.9,0.1\nb,2,,y,0.2,0.8\n"));
    let fused = done(&["fuse", text(&empty), text(&one), "-o", "-"]);
    assert!(fused.contains("a,1,x,x,") && fused.contains("b,2,y,y,"), "{fused}");
    let other = put("3.csv", &format!("{head}a,1,y,x,0.9,0.1\nb,2,y,y,0.2,0.8\n"));
    let found = refused(&["fuse", text(&empty), text(&one), text(&other), "-o", "-"]);
    assert!(found.contains("id a: true is y here and x in"), "{found}");
    let partly = put("w.csv", "id,start,true,predicted\na,0,,x\na,1,x,x\n");
    let voted = done(&["fuse", text(&partly), "--vote", "majority", "-o", "-"]);
    assert!(voted.contains("a,x,x"), "{voted}");
    // Other labels: the first window, or file, had the last word.
    let levels =
        put("w.csv", "id,start,level,kind,predicted\na,0,1,,x\na,1,2,z,x\na,2,1,z,y\nb,0,3,,y\n");
    let voted = done(&["fuse", text(&levels), "--vote", "majority", "-o", "-"]);
    assert!(voted.starts_with("id,level,kind,predicted,p_x,p_y\na,,z,x,"), "{voted}");
    assert!(voted.contains("\nb,3,,y,"), "{voted}");
    let level = |a: &str| format!("id,level,predicted,p_x,p_y\na,{a},x,0.9,0.1\nb,2,y,0.2,0.8\n");
    let (one, two) = (put("4.csv", &level("1")), put("5.csv", &level("2")));
    let fused = done(&["fuse", text(&one), text(&two), "-o", "-"]);
    assert!(fused.contains("\na,,x,") && fused.contains("\nb,2,y,"), "{fused}");
    let lengths = put("w.csv", "id,start,end,predicted\na,0,1,x\na,0,2,y\na,1,2,y\n");
    assert!(done(&["fuse", text(&lengths), "--vote", "majority", "-o", "-"]).contains("\na,y,"));
}

#[test]
fn other_folds_are_not_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.csv"), folder.path().join("b.csv"));
    std::fs::write(&a, "id,fold,true,predicted\nr,1,x,x\ns,2,y,y\n").unwrap();
    std::fs::write(&b, "id,fold,true,predicted\nr,2,x,x\ns,1,y,y\n").unwrap();
    let output = run(&["compare-predictions", text(&a), text(&b)]);
    assert!(output.status.success());
    let (shown, warned) = (String::from_utf8(output.stdout), String::from_utf8(output.stderr));
    assert!(!shown.unwrap().contains("folds"));
    assert!(warned.unwrap().contains("its folds are not those of"));
}

#[test]
fn two_classifiers_are_tested_on_the_same_rows() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.csv"), folder.path().join("b.csv"));
    // The first errs in two rows, the second in eight others: p = 0.109375 by the binomial test.
    let table = |wrong: std::ops::Range<usize>| -> String {
        let line = |row: usize| {
            let predicted = if wrong.contains(&row) { "tea" } else { "rice" };
            format!("r{row},{},rice,{predicted},0.5,0.5\n", row % 4)
        };
        format!("id,fold,true,predicted,p_rice,p_tea\n{}", (0..20).map(line).collect::<String>())
    };
    std::fs::write(&a, table(0..2)).unwrap();
    std::fs::write(&b, table(2..10)).unwrap();
    let compare = ["compare-predictions", text(&a), text(&b)];
    let report: Value = serde_json::from_str(&done(&[&compare[..], &["--json"]].concat())).unwrap();
    assert_eq!(report["mcnemar"]["only_first"], 8);
    assert_eq!(report["mcnemar"]["only_second"], 2);
    assert!((report["mcnemar"]["p_value"].as_f64().unwrap() - 0.109_375).abs() < 1e-12);
    assert_eq!(report["folds"], 4);
    let difference = report["bootstrap_folds"]["difference"].as_f64().unwrap();
    assert!(difference < 0.0 && report["bootstrap_rows"]["difference"] == difference);
    let shown = done(&compare);
    for part in ["McNemar: 8 right only in the first, 2 only", "over recordings", "over 4 folds"] {
        assert!(shown.contains(part), "{shown}");
    }
    let other = folder.path().join("other.csv");
    for (lines, message) in [
        (table(0..2).replace("r7,", "r77,"), "\"r77\" is not in"),
        (table(0..2).lines().take(9).collect::<Vec<_>>().join("\n"), "\"r8\" is not in"),
        (table(0..2).replace("r7,3,rice", "r7,3,tea"), "\"r7\" is rice here and tea in"),
        (table(0..2).replace("r7,", "r6,"), "more than one row: id r6"),
        ("id,predicted\nr,x\n".into(), "no column \"true\" with true classes"),
        ("id,true,predicted\n".into(), "has no predictions"),
    ] {
        std::fs::write(&other, lines).unwrap();
        let found = refused(&["compare-predictions", text(&a), text(&other)]);
        assert!(found.contains(message), "{found}");
    }
}

/// The output took the place of a table that it was made of.
#[test]
fn outputs_do_not_replace_what_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.csv");
    let rows = "id,true,predicted\na,x,x\nb,y,y\n";
    std::fs::write(&file, rows).unwrap();
    let file = text(&file);
    for words in [
        vec!["fuse", file, "-o", file],
        vec!["fuse", "--type", file, "-o", file],
        vec!["train", file, "-o", file],
        vec!["train", "x.npz", "--labels", file, "-o", file],
        vec!["cross-validate", file, "--predictions", file],
        vec!["classify", "-m", file, "x.wav", "-o", file],
        vec!["classify", "-m", "x.model", file, "-o", file],
        vec!["capacity", "combine", "--in", file, "-o", file],
    ] {
        let message = refused(&[&words[..], &["--overwrite"]].concat());
        assert!(message.contains("the output would replace an input"), "{words:?}: {message}");
    }
    assert_eq!(std::fs::read_to_string(file).unwrap(), rows);
}
