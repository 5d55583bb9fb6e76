//! `synth`, `dataset check`, `evaluate` and `benchmark` as a user runs them.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_corsmal-feat")).args(arguments).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

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
    assert!(lines(&checked.stdout).contains("odd.wav: its name is none of the data set's"));

    let (data, out_dir) = (text(&data), text(&out));
    let names = ["zcr-mfcc-knn", "zcr-mfcc-rf"];
    let reported =
        run(&["benchmark", "--data", data, "--out", out_dir, "--baselines", names[0], names[1]]);
    assert!(reported.status.success(), "{}", lines(&reported.stderr));
    assert!(lines(&reported.stdout).contains("SYNTHETIC"));
    assert!(out.join("report.html").exists());

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
    ] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let message = lines(&output.stderr);
        assert!(message.starts_with("error: ") && message.lines().count() == 1, "{message}");
    }
    assert!(!none.exists());
}
