//! The systems of the paper in `benchmark`.

use serde_json::Value;

use crate::command::{done, refused, text};

/// `24.4–33.8`, unlike the dash where there is no score.
fn is_interval(word: &str) -> bool {
    word.split_once('\u{2013}').is_some_and(|(low, high)| !low.is_empty() && !high.is_empty())
}

#[test]
fn systems_of_the_paper_join_the_benchmark() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("ccm"), folder.path().join("report"));
    done(&["synth", "--out", text(&data), "--small", "--quiet"]);
    let folders = ["benchmark", "--data", text(&data), "--out", text(&out)];
    let scores = done(&[&folders[..], &["--methods", "m1,m2,m5", "--epochs", "1"]].concat());
    // Baselines run only where they are asked for.
    assert!(!scores.contains("kNN"), "{scores}");
    for (name, tasks) in [("M1", 2), ("M2", 1), ("M5", 2)] {
        let line = scores.lines().find(|line| line.starts_with(name)).unwrap();
        assert_eq!(
            line.split_whitespace().filter(|word| is_interval(word)).count(),
            tasks,
            "{line}"
        );
    }
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let submission = read("submissions/m1-held-out.csv");
    assert_eq!(submission.lines().count(), 58, "{submission}");
    for name in ["figures/m1-joint-confusion.svg", "figures/m2-type-confusion.svg"] {
        assert!(out.join(name).exists(), "{name}");
    }
    assert!(!out.join("figures/m2-level-confusion.svg").exists());
    let report: Value = serde_json::from_str(&read("report.json")).unwrap();
    let report = report.to_string();
    for note in [
        "m2_type was trained for 1 epoch; its recipe has 500.",
        "type only; its capacity needs the depth views.",
        "vggish embeddings were not given",
    ] {
        assert!(report.contains(note), "{note}");
    }
    // The paper's figures stand beside.
    let table = read("tables/type.csv");
    let rows = table.lines().filter(|line| line.split(',').nth(1) == Some("M2")).count();
    assert_eq!(rows, 2, "{table}");

    let refuse = |more: &[&str], expected: &str| {
        let message = refused(&[&folders[..], more].concat());
        assert!(message.contains(expected), "{message}");
    };
    refuse(
        &["--methods", "m3", "--quiet"],
        "no training recording has a table of detections with a container",
    );
    refuse(&["--methods", "m9"], "m1, m2, m3, m4, m5, m6");
    refuse(&["--methods", "m1,M1"], "given twice");
    let nowhere = "yamnet=nowhere.npz";
    refuse(&["--methods", "m5", "--embeddings", nowhere, "--quiet"], "vggish and r21d");
}

/// M3's perceptrons by the category that detections vote for.
#[test]
fn the_voted_category_chooses_the_perceptrons() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("ccm"), folder.path().join("report"));
    let tables = folder.path().join("tables");
    done(&["synth", "--out", text(&data), "--small", "--quiet"]);
    let mut recordings: Vec<(usize, String)> = Vec::new();
    for container in 1..=9 {
        let audio = data.join(format!("train/{container}/audio"));
        for entry in std::fs::read_dir(audio).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            recordings.push((container, name.strip_suffix("_audio.wav").unwrap().to_owned()));
        }
    }
    recordings.sort();
    // A glass is taken for a box in one recording, and nothing is seen in another.
    for (at, (container, name)) in recordings.iter().enumerate() {
        let label = ["cup", "wine glass", "book"][(container - 1) / 3];
        let label = if at == 20 { "suitcase" } else { label };
        let label = if at == 40 { "person" } else { label };
        let rows: String =
            (1..=4).map(|view| format!("0,{view},{label},0.9,0,0,50,80\n")).collect();
        std::fs::create_dir_all(tables.join(container.to_string())).unwrap();
        let header = "frame,view,label,score,x_min,y_min,x_max,y_max\n";
        let path = tables.join(format!("{container}/{name}.csv"));
        std::fs::write(path, format!("{header}{rows}")).unwrap();
    }
    // One table is damaged, and one is missing.
    let table = |at: usize| {
        let (container, name): &(usize, String) = &recordings[at];
        tables.join(format!("{container}/{name}.csv"))
    };
    std::fs::write(table(3), "frame\n0\n").unwrap();
    std::fs::remove_file(table(30)).unwrap();
    let words = ["benchmark", "--data", text(&data), "--out", text(&out), "--methods", "m3"];
    let words = [&words[..], &["--detections", text(&tables), "--epochs", "1"]].concat();
    let scores = done(&words);
    let line = scores.lines().find(|line| line.starts_with("M3 ")).unwrap();
    assert_eq!(line.split_whitespace().filter(|word| is_interval(word)).count(), 2, "{line}");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let submission = read("submissions/m3-held-out.csv");
    assert_eq!(submission.lines().filter(|line| line.ends_with(",-1,-1,-1")).count(), 3);
    // Beside the paper's row, with the same inputs.
    for task in ["level", "type"] {
        let table = read(&format!("tables/{task}.csv"));
        let rows: Vec<&str> = table.lines().filter(|l| l.split(',').nth(1) == Some("M3")).collect();
        assert_eq!(rows.len(), 2, "{table}");
        assert!(rows.iter().all(|row| row.contains("RGB 1 2 3 4")), "{rows:?}");
    }
    assert!(out.join("figures/m3-joint-confusion.svg").exists());
    let report = read("report.json");
    let told = recordings.len() - 4;
    for note in [
        "1 training recordings have no table of detections",
        "1 training recordings show no container to the detector",
        "1 damaged files count as if nothing was detected; the first, ",
        &format!("the vote finds the category of {told} of 57 training recordings"),
        "m3_mlp was trained for 1 epoch; its recipe has 100.",
    ] {
        assert!(report.contains(note), "{note}");
    }
    let report = report.replace("\\\\", "/");
    assert!(report.contains(&format!("{}.csv", recordings[3].1)), "the damaged table");
}
