//! `synth`, `dataset check`, `evaluate` and `benchmark` as a user runs them.

use std::path::Path;

use crate::command::{run, text};

fn lines(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn from_synthetic_recordings_to_the_report() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("report"));
    let made = run(&["synth", "--out", text(&data), "--small"]);
    assert!(made.status.success(), "{}", lines(&made.stderr));
    assert!(lines(&made.stdout).contains("57 synthetic recordings"));

    let checked = run(&["dataset", "check", text(&data), "--json"]);
    assert!(checked.status.success());
    let findings: serde_json::Value = serde_json::from_slice(&checked.stdout).unwrap();
    assert_eq!(findings["synthetic"], true);
    assert_eq!(findings["recordings"], 57);
    std::fs::write(data.join("train/1/audio/odd.wav"), "x").unwrap();
    let checked = run(&["dataset", "check", text(&data)]);
    assert_eq!(checked.status.code(), Some(1));
    assert!(lines(&checked.stdout).contains("odd.wav: its name is not one of the data set's"));

    let (data, out_dir) = (text(&data), text(&out));
    let names = ["zcr-mfcc-knn", "zcr-mfcc-rf"];
    let reported =
        run(&["benchmark", "--data", data, "--out", out_dir, "--baselines", names[0], names[1]]);
    assert!(reported.status.success(), "{}", lines(&reported.stderr));
    assert!(lines(&reported.stdout).contains("SYNTHETIC"));
    assert!(out.join("report.html").exists());

    // Files of a run before stay, and are named.
    let again =
        run(&["benchmark", "--data", data, "--out", out_dir, "-q", "--baselines", names[1]]);
    let said = lines(&again.stderr);
    assert!(
        again.status.success() && said.contains("files are not of this run: models/"),
        "{said}"
    );
    assert!(said.contains("models/zcr-mfcc-knn-") && !said.contains("zcr-mfcc-rf"), "{said}");

    // What is not cropped as the paper's were is said; also where times are milliseconds.
    let actions = Path::new(data).join("man_annotations.csv");
    let late = |cell: &str| match cell.parse::<f64>() {
        Ok(seconds) if cell.contains('.') => (1000.0 * seconds).to_string(),
        _ => cell.to_string(),
    };
    let table = std::fs::read_to_string(&actions).unwrap();
    let rows = table.lines().map(|row| row.split(',').map(late).collect::<Vec<_>>().join(","));
    std::fs::write(&actions, rows.collect::<Vec<_>>().join("\n")).unwrap();
    let whole = out.join("whole");
    let uncropped = ["--out", text(&whole), "-q", "--baselines", "spectrogram-knn"];
    let said = lines(&run(&[&["benchmark", "--data", data], &uncropped[..]].concat()).stderr);
    assert!(said.contains("an annotated action that begins after their end"), "{said}");
    let odd = lines(&run(&["dataset", "check", data]).stdout);
    assert!(odd.contains("its annotated action begins at"), "{odd}");
    std::fs::remove_file(&actions).unwrap();
    let said = lines(&run(&[&["benchmark", "--data", data], &uncropped[..]].concat()).stderr);
    assert!(said.contains("training recordings have no annotated action"), "{said}");
    let page = std::fs::read_to_string(whole.join("report.html")).unwrap();
    assert!(page.contains("no annotated action"));

    // Its models take recordings, its features are training files.
    let (model, folder) =
        (out.join("models/zcr-mfcc-rf-corrected.model"), format!("{data}/train/2"));
    let classified = run(&["classify", "--model", text(&model), "--in", &folder, "-q"]);
    assert!(classified.status.success(), "{}", lines(&classified.stderr));
    assert!(lines(&classified.stdout).starts_with("id,path,status,predicted,p_empty,p_pasta half"));
    assert_eq!(classified.stdout.iter().filter(|&&b| b == b'\n').count(), 1 + 7);
    let kept = std::fs::read_dir(out.join("features")).unwrap().next().unwrap().unwrap().path();
    let learn = ["--features", text(&kept), "--target", "type", "--classifier", "knn"];
    let validated = run(&[&["cross-validate"], &learn[..]].concat());
    assert!(lines(&validated.stdout).contains("each container once"));

    let submission = out.join("submissions/zcr-mfcc-rf-corrected-held-out.csv");
    let annotations = Path::new(data).join("ccm_train_annotation.csv");
    let (submission, annotations) = (text(&submission), text(&annotations));
    let files = ["--submission", submission, "--annotations", annotations];
    let scored =
        run(&[&["evaluate"], &files[..], &["--rules", "paper", "--format", "json"]].concat());
    assert!(scored.status.success(), "{}", lines(&scored.stderr));
    let scores: serde_json::Value = serde_json::from_slice(&scored.stdout).unwrap();
    // By simple physics the type is easy to hear.
    assert!(scores["T2"].as_f64().unwrap() > 50.0, "{scores}");
    assert_eq!(scores["recordings"], 57);
}

#[test]
fn the_demo_ends_with_model_predictions_scores_and_report() {
    let dir = tempfile::tempdir().unwrap();
    let shown = run(&["demo", "--out", text(dir.path())]);
    assert!(shown.status.success(), "{}", lines(&shown.stderr));
    let shown = lines(&shown.stdout);
    for part in [
        "$ corsmal-feat synth --out",
        "$ corsmal-feat benchmark --data",
        "$ corsmal-feat classify --model",
        "$ corsmal-feat evaluate --submission",
        "SYNTHETIC",
        "rules paper, 57 recordings",
        "--capacity m5",
        "capacity, percent",
        "ZCR + MFCCs + RF, capacity M5",
        "error of the object's weight, newtons",
        "report/report.html",
    ] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    let made = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    let measured = made("report/capacity/m5.csv");
    assert_eq!(measured.matches(",m5,ok,").count() + measured.matches(",m5,prior,").count(), 57);
    assert!(made("report/tables/mass.csv").contains("ZCR + MFCCs + RF, capacity M5"));
    assert_eq!(made("predictions.csv").lines().count(), 1 + 7);
    assert!(made("report/report.html").contains("SYNTHETIC"));
}

#[test]
fn unusable_input_is_one_message_and_exit_code_2() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("s.csv");
    std::fs::write(&file, "Configuration ID\n0\n").unwrap();
    let none = dir.path().join("none");
    for arguments in [
        vec!["evaluate", "--submission", text(&file), "--annotations", text(&file)],
        vec!["evaluate", "--submission", text(&file), "--annotations", text(&none)],
        vec!["dataset", "check", text(dir.path())],
        vec!["benchmark", "--data", text(&none), "--out", text(&none)],
        vec!["synth", "--out", text(dir.path())],
        [&["benchmark", "--data", "x", "--out", "y"], &["--baselines", "af193-rf", "af193-rf"][..]]
            .concat(),
        vec!["benchmark", "--data", text(&none), "--out", text(&none), "--capacity", "m5", "-q"],
    ] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let message = lines(&output.stderr);
        assert!(message.starts_with("error: ") && message.lines().count() == 1, "{message}");
    }
    assert!(!none.exists());
}

/// Every fault of a submission is one message with file, line and column, and no scores.
#[test]
fn submissions_with_faults_are_refused_and_quirks_are_noted() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    let made = run(&["synth", "--out", text(&data), "--small", "--quiet"]);
    assert!(made.status.success());
    let annotations = data.join("ccm_train_annotation.csv");
    // Estimates for every annotated recording, none of them right.
    let table = std::fs::read_to_string(&annotations).unwrap();
    let ids: Vec<&str> = table.lines().skip(1).map(|l| l.split(',').next().unwrap()).collect();
    let header = "Configuration ID,Container capacity,Container mass,Filling mass,None,Pasta,Rice,\
        Water,Filling type,Empty,Half-full,Full,Filling level,Width at the top,\
        Width at the bottom,Height,Object safety,Distance,Angle difference,Execution time";
    let row = |id: &str| format!("{id},100,-1,-1,-1,-1,-1,-1,1,-1,-1,-1,2,-1,-1,-1,-1,-1,-1,-1");
    let rows: Vec<String> = ids.iter().map(|id| row(id)).collect();
    let file = dir.path().join("s.csv");
    let evaluate = |rows: &[String]| {
        std::fs::write(&file, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
        let files = ["--submission", text(&file), "--annotations", text(&annotations)];
        run(&[&["evaluate"], &files[..], &["--format", "json"]].concat())
    };
    let sound = evaluate(&rows);
    assert!(sound.status.success(), "{}", lines(&sound.stderr));
    let changed = |at: usize, to: String| {
        let mut rows = rows.clone();
        rows[at] = to;
        rows
    };
    let (cut, extra) = (rows[1..].to_vec(), [&rows[..], &[row("999")]].concat());
    for (rows, message) in [
        (cut, format!("missing rows: id {}", ids[0])),
        (extra, "rows that the annotations lack: id 999".into()),
        (changed(1, row(ids[0])), format!("more than one row: id {}", ids[0])),
        (
            changed(2, rows[2].replace(",100,", ",much,")),
            "line 4, column 'Container capacity'".into(),
        ),
        (changed(2, rows[2].replace(",-1,1,-1", ",-1,9,-1")), "column 'Filling type': '9'".into()),
        (
            changed(2, rows[2].replace(",-1,2,-1", ",-1,1.5,-1")),
            "column 'Filling level': '1.5'".into(),
        ),
    ] {
        let output = evaluate(&rows);
        let found = lines(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{found}");
        assert!(found.contains(&message) && output.stdout.is_empty(), "{message}: {found}");
    }
    // Only what addresses the container's mass has an error of the weight.
    let weighed: Vec<_> = rows.iter().map(|r| r.replacen(",100,-1", ",100,10", 1)).collect();
    let other = dir.path().join("with, mass.csv");
    std::fs::write(&other, format!("{header}\n{}\n", weighed.join("\n"))).unwrap();
    std::fs::write(&file, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    let both = ["evaluate", text(&file), text(&other), "--rules", "paper"];
    let both = [&both[..], &["--annotations", text(&annotations)]].concat();
    let csv = lines(&run(&[&both[..], &["--format", "csv"]].concat()).stdout);
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let columns = reader.headers().unwrap().clone();
    let found: Vec<_> = reader.records().map(|record| record.unwrap()).collect();
    assert_eq!(&columns[columns.len() - 1], "weight_error_N");
    assert_eq!((&found[0][0], &found[0][columns.len() - 1]), ("s", ""));
    assert_eq!(&found[1][0], "with, mass");
    assert!(found[1][columns.len() - 1].parse::<f64>().unwrap() > 0.0);
    let table = lines(&run(&both).stdout);
    let width = |line: &str| line.split_whitespace().count();
    let shown: Vec<_> = table.lines().collect();
    assert_eq!(width(shown[1]), width(shown[2]) + 1, "{table}");
    // The thirteen scores of the toolkit fit a terminal, for one submission and for several.
    let one = ["evaluate", "--submission", text(&file), "--annotations", text(&annotations)];
    let several = ["evaluate", text(&file), text(&other), "--annotations", text(&annotations)];
    for arguments in [&one[..], &several[..]] {
        let table = lines(&run(arguments).stdout);
        assert!(table.contains("filling level, weighted F1"), "{table}");
        assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    }
    let reversed = run(&[&both[..], &["--containers", "5-2"]].concat());
    assert_eq!(reversed.status.code(), Some(2));
    // A float label is a quirk of the official evaluators: scored as they do, and said.
    let output = evaluate(&changed(2, rows[2].replace(",-1,1,-1", ",-1,1.0,-1")));
    let scores: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(scores["s2"], 0.0);
    assert!(scores["notes"][0].as_str().unwrap().contains("floating-point"), "{scores}");
}
