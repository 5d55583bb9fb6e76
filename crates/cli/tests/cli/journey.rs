//! The whole way of a user with recordings of their own: features, model, predictions, scores,
//! reports.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::command::{done, names, run, text};

const RATE: u32 = 16_000;
const CLASSES: [&str; 3] = ["hum", "rain", "ticks"];

/// A second and a half of a class.
fn sound(class: &str, seed: u64) -> Vec<i16> {
    let mut state = seed.wrapping_mul(0x9e37_79b9).wrapping_add(1);
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_041);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let pitch = 180.0 + 15.0 * seed as f64;
    let sample = |t: u32| {
        let s = f64::from(t) / f64::from(RATE);
        let noise = noise();
        let value = match class {
            "hum" => 0.6 * (std::f64::consts::TAU * pitch * s).sin() + 0.02 * noise,
            "rain" => 0.5 * noise,
            _ if (s * 8.0).fract() < 0.05 => 0.8 * noise,
            _ => 0.01 * noise,
        };
        (value * 20_000.0) as i16
    };
    (0..RATE + RATE / 2).map(sample).collect()
}

struct Journey {
    folder: tempfile::TempDir,
}

impl Journey {
    /// Class folders with eight recordings each, and one file that is no recording.
    fn begin() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let spec = hound::WavSpec {
            channels: 1,
            sample_rate: RATE,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        for class in CLASSES {
            let dir = folder.path().join("audio").join(class);
            std::fs::create_dir_all(&dir).unwrap();
            for number in 0..8 {
                let path = dir.join(format!("{class}{number}.wav"));
                let mut writer = hound::WavWriter::create(path, spec).unwrap();
                sound(class, number).into_iter().for_each(|s| writer.write_sample(s).unwrap());
                writer.finalize().unwrap();
            }
        }
        std::fs::write(folder.path().join("audio/hum/broken.wav"), "RIFF").unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A report as JSON.
    fn report(&self, name: &str) -> Value {
        let text = std::fs::read_to_string(self.path(name).join("report.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    }
}

fn sections(report: &Value) -> Vec<&str> {
    let sections = report["sections"].as_array().unwrap();
    sections.iter().map(|s| s["id"].as_str().unwrap()).collect()
}

#[track_caller]
fn holds(page: &Path, parts: &[&str]) {
    let html = std::fs::read_to_string(page).unwrap();
    for part in parts {
        assert!(html.contains(part), "{part:?} is not in {}", page.display());
    }
}

#[test]
fn from_a_folder_to_a_report() {
    let j = Journey::begin();
    let (audio, table) = (j.path("audio"), j.path("table.npz"));
    let (model, csv, held) = (j.path("sounds.model"), j.path("out.csv"), j.path("held.csv"));

    let extracted = run(&["extract", text(&audio), "-o", text(&table), "--preset", "esc26", "-q"]);
    assert_eq!(extracted.status.code(), Some(1), "one file is no recording");

    let learn = [text(&table), "--labels", "folders", "--set", "trees=25"];
    let trained = done(&[&["train"], &learn[..], &["-o", text(&model)]].concat());
    assert!(trained.contains("class: hum (8), rain (8), ticks (8)"), "{trained}");
    assert!(trained.contains("next: corsmal-feat classify"), "{trained}");

    let classify = ["classify", "--model", text(&model), text(&audio), "-o", text(&csv), "-q"];
    assert_eq!(run(&classify).status.code(), Some(1));
    assert_eq!(std::fs::read_to_string(&csv).unwrap().lines().count(), 1 + 25);

    // The broken file lies in a class folder: it counts as a recording without a prediction.
    let scored = done(&["score", text(&csv), "--labels", "folders"]);
    for part in ["25 rows, 3 classes", "1 without a prediction counts as wrong", "Brier score"] {
        assert!(scored.contains(part), "{part}: {scored}");
    }

    let report = j.path("report");
    let validate = [&["cross-validate"], &learn[..], &["--cv", "4", "-o", text(&held)]].concat();
    let validated = [&validate[..], &["--seeds", "2", "--report", text(&report)]].concat();
    let told = done(&validated);
    for part in ["bootstrap over 24 rows", "calibration error", "2 seeds, percent", "ROC area"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    assert!(told.lines().all(|line| line.chars().count() <= 80), "{told}");
    let found = j.report("report");
    let all =
        ["scores", "confusion", "curves", "errors", "data", "examples", "importances", "learning"];
    assert_eq!(sections(&found), all);
    let parts = ["broken", "hum: hum0.wav", "all rows, seed 1", "mfcc (24)", "Command", "<svg"];
    holds(&report.join("report.html"), &parts);
    for name in ["tables/scores.tex", "tables/classes.csv", "figures/confusion.pdf"] {
        assert!(report.join(name).is_file(), "{name}");
    }

    // The same numbers, three ways.
    let json = [&validate[..], &["--json", "--overwrite"]].concat();
    let json: Value = serde_json::from_str(&done(&json)).unwrap();
    let again: Value = serde_json::from_str(&done(&["score", text(&held), "--json"])).unwrap();
    let accuracy = json["held_out"]["scores"]["accuracy"].as_f64().unwrap();
    assert!(accuracy > 0.9, "{accuracy}");
    for key in ["scores", "intervals", "calibration", "roc_auc"] {
        assert_eq!(json["held_out"][key], again[key], "{key}");
    }
    assert_eq!(found["sections"][0]["tables"][0]["rows"][0]["cells"][1], 100.0 * accuracy);
}

/// A recording with stretches of several classes is an example of each; another file at its path is none.
#[test]
fn stretches_of_one_recording_are_examples_of_their_classes() {
    let j = Journey::begin();
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut list = String::from("path,start,end,class\n");
    for number in 0..3 {
        let name = format!("long{number}.wav");
        let mut writer = hound::WavWriter::create(j.path(&name), spec).unwrap();
        for (part, class) in ["hum", "rain", "hum", "rain"].into_iter().enumerate() {
            let samples = sound(class, 4 * number + part as u64);
            samples.into_iter().for_each(|s| writer.write_sample(s).unwrap());
            let start = 1.5 * part as f64;
            list += &format!("{name},{start},{},{class}\n", start + 1.5);
        }
        writer.finalize().unwrap();
    }
    // Those without features had no note, as rows of a recording that has some.
    list += "long1.wav,90,91,hum\n";
    std::fs::write(j.path("list.csv"), list).unwrap();
    let (table, report) = (j.path("t.npz"), j.path("report"));
    let at = ["--preset", "esc26", "--set", "signal.start=0.25", "-q"];
    let listed = j.path("list.csv");
    let extract = [&["extract", text(&listed), "-o", text(&table)], &at[..]].concat();
    assert_eq!(run(&extract).status.code(), Some(1));
    let validate = ["cross-validate", text(&table), "--target", "class", "--cv", "group=recording"];
    let write = ["--set", "trees=25", "--report", text(&report), "--overwrite", "-q"];
    let validate = [&validate[..], &write[..]].concat();
    done(&validate);
    holds(&report.join("report.html"), &["hum: long0.wav", "rain: long0.wav"]);
    holds(&report.join("tables/notes.csv"), &["long1.wav", "long1@90.0-91.0: ", "after the end"]);

    std::fs::copy(j.path("audio/ticks/ticks0.wav"), j.path("long0.wav")).unwrap();
    let again = run(&validate);
    let message = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.success(), "{message}");
    assert!(
        message.contains("1 of 3 recordings are no longer those that the features"),
        "{message}"
    );
    holds(&report.join("report.html"), &["hum: long1.wav", "another file than the one"]);
}

#[test]
fn windows_are_listened_to_where_they_are() {
    let j = Journey::begin();
    let (audio, table, report) = (j.path("audio"), j.path("w.npz"), j.path("report"));
    std::fs::remove_file(audio.join("hum/broken.wav")).unwrap();
    // Ticks as hum, so that errors are certain.
    std::fs::rename(audio.join("ticks/ticks0.wav"), audio.join("hum/ticks0.wav")).unwrap();
    let cut = ["--preset", "esc26", "--window", "0.5", "--hop", "0.5", "-q"];
    done(&[&["extract", text(&audio), "-o", text(&table)], &cut[..]].concat());
    let validate =
        ["cross-validate", text(&table), "--labels", "folders", "--cv", "4", "--set", "trees=25"];
    let held = j.path("held.csv");
    let more = ["-o", text(&held), "--report", text(&report)];
    let told = done(&[&validate[..], &more[..]].concat());
    assert!(told.contains("bootstrap over 24 groups (column group)"), "{told}");
    let header = std::fs::read_to_string(&held).unwrap();
    assert!(header.starts_with("id,fold,group,true,predicted,"), "{header}");
    holds(&report.join("report.html"), &["hum/ticks0@0.5", "0.50 to 1.00 s"]);

    // Recordings that were moved away are no reason to fail.
    std::fs::rename(&audio, j.path("elsewhere")).unwrap();
    let again = [&validate[..], &["--report", text(&report), "-q"]].concat();
    let refused = run(&again);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(message.contains("has a report already; --overwrite replaces it"), "{message}");
    for name in ["of-another.csv", "notes.csv"] {
        std::fs::write(report.join("tables").join(name), "a\n").unwrap();
    }
    let mut another = j.report("report");
    another["files"].as_array_mut().unwrap().push("tables/of-another.csv".into());
    std::fs::write(report.join("report.json"), another.to_string()).unwrap();
    let moved = run(&[&again[..], &["--overwrite"]].concat());
    assert!(!report.join("tables/of-another.csv").exists());
    assert!(report.join("tables/notes.csv").exists());
    let message = String::from_utf8_lossy(&moved.stderr).into_owned();
    assert!(moved.status.success() && moved.stdout.is_empty(), "{message}");
    assert!(message.contains("24 of 24 recordings are no longer at their paths"), "{message}");
    assert!(!sections(&j.report("report")).contains(&"data"));
}

#[test]
fn predictions_and_estimates_have_reports_of_their_own() {
    let j = Journey::begin();
    let (csv, report) = (j.path("p.csv"), j.path("report"));
    let wav = j.path("audio/hum/hum0.wav");
    let line = |id: &str, truth: &str, found: &str, p: &str| {
        format!("{id},{},{truth},{found},{p}\n", wav.display())
    };
    let rows = [
        line("1", "hum", "hum", "0.9,0.1"),
        line("2", "rain", "hum", "0.8,0.2"),
        line("3", "rain", "rain", "0.45,0.55"),
    ];
    let text_of = format!("id,path,true,predicted,p_hum,p_rain\n{}", rows.concat());
    std::fs::write(&csv, text_of).unwrap();
    done(&["score", text(&csv), "--reject", "0.6", "--report", text(&report)]);
    let found = j.report("report");
    assert_eq!(sections(&found), ["scores", "confusion", "curves", "errors", "data", "examples"]);
    let errors = &found["sections"][3];
    assert!(errors["text"][0].as_str().unwrap().ends_with("1 without a prediction."));
    assert_eq!(errors["tables"][0]["rows"].as_array().unwrap().len(), 1);
    let identity = corsmal_files::identity::of_file(&csv).unwrap();
    let facts = ["was trained without these recordings", &identity, "2000 resamples, seed 0"];
    holds(&report.join("report.html"), &facts);

    std::fs::write(&csv, "id,capacity,predicted\n1,100.5,90\n2,200.5,300\n3,50,-1\n").unwrap();
    done(&["score", text(&csv), "--target", "capacity", "--report", text(&report), "--overwrite"]);
    assert_eq!(j.report("report")["summary"], "capacity: 3 rows, 1 of them without an estimate.");
    assert!(names(&report.join("figures")).contains(&"estimates.pdf".into()));
}

/// Windows go the whole way, and count as what they are: parts of recordings.
#[test]
fn windows_are_scored_and_voted_on() {
    let j = Journey::begin();
    std::fs::remove_file(j.path("audio/hum/broken.wav")).unwrap();
    let (audio, table, model) = (j.path("audio"), j.path("w.npz"), j.path("w.model"));
    let cut = ["--preset", "esc26", "--window", "0.5", "-q"];
    done(&[&["extract", text(&audio), "-o", text(&table)], &cut[..]].concat());
    let learn = ["--labels", "folders", "--set", "trees=25", "-q", "-o", text(&model)];
    done(&[&["train", text(&table)], &learn[..]].concat());

    let (windows, rows) = (j.path("windows.csv"), j.path("rows.csv"));
    let classify = ["classify", "-m", text(&model), "-q", "-o"];
    done(&[&classify[..], &[text(&windows), text(&audio), "--window", "0.5"]].concat());
    done(&[&classify[..], &[text(&rows), "--features", text(&table)]].concat());
    let score = ["score", text(&windows), "--labels", "folders", "--json"];
    let scored: Value = serde_json::from_str(&done(&score)).unwrap();
    assert_eq!((&scored["rows"], &scored["units"]), (&120.into(), &24.into()), "{scored}");
    assert_eq!(scored["drawn"], "recording");
    for file in [&windows, &rows] {
        let voted = j.path("voted.csv");
        let vote = ["fuse", text(file), "--vote", "majority", "--overwrite", "-o", text(&voted)];
        done(&vote);
        assert_eq!(std::fs::read_to_string(&voted).unwrap().lines().count(), 1 + 24);
    }
    // Those of a cross-validation, which have no column of the recording.
    let held_out = j.path("held_out.csv");
    let learn = ["--labels", "folders", "--cv", "3", "--set", "trees=5", "-q", "-o"];
    done(&[&["cross-validate", text(&table)], &learn[..], &[text(&held_out)]].concat());
    let voted = j.path("voted.csv");
    let fuse = ["fuse", text(&held_out), "--vote", "mean", "--overwrite", "-o", text(&voted)];
    let fused = run(&fuse);
    assert!(String::from_utf8_lossy(&fused.stderr).contains("24 recordings"), "{fused:?}");
    let scored: Value = serde_json::from_str(&done(&["score", text(&voted), "--json"])).unwrap();
    assert_eq!(scored["rows"], 24);
    // Only one of the files has folds.
    let compared =
        run(&["compare-predictions", text(&held_out), text(&rows), "--labels", "folders"]);
    let told = String::from_utf8_lossy(&compared.stderr).into_owned();
    assert!(told.contains("has folds") && told.contains("unfair"), "{told}");
    assert!(!String::from_utf8_lossy(&compared.stdout).contains("folds"), "{compared:?}");
    let nothing = run(&["fuse", text(&j.path("voted.csv")), "--vote", "majority", "-o", "-"]);
    let message = String::from_utf8_lossy(&nothing.stderr).into_owned();
    assert!(message.contains("nothing to vote on"), "{message}");
}

/// Stretches of one file are never on both sides of a split; predictions of cross-validation find
/// the labels of the manifest.
#[test]
fn stretches_of_a_file_are_held_out_together() {
    let j = Journey::begin();
    let mut manifest = String::from("path,start,end,class\n");
    for class in CLASSES {
        for number in 0..8 {
            for start in [0.0, 0.5, 1.0] {
                let end = start + 0.5;
                manifest += &format!("audio/{class}/{class}{number}.wav,{start},{end},{class}\n");
            }
        }
    }
    let (list, table, held) = (j.path("list.csv"), j.path("table.npz"), j.path("held.csv"));
    std::fs::write(&list, manifest).unwrap();
    done(&["extract", text(&list), "-o", text(&table), "--preset", "esc26", "-q"]);
    let validate = ["cross-validate", text(&table), "--target", "class", "--set", "trees=25"];
    let told = done(&[&validate[..], &["--cv", "4", "-o", text(&held)]].concat());
    assert!(told.contains("4 folds (recording)") && told.contains("(6 groups)"), "{told}");
    assert!(told.lines().all(|line| line.chars().count() <= 80), "{told}");
    let csv = std::fs::read_to_string(&held).unwrap();
    let mut folds = std::collections::BTreeMap::new();
    for line in csv.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let file = cells[0].split('@').next().unwrap().to_string();
        assert_eq!(*folds.entry(file).or_insert(cells[1]), cells[1], "{line}");
    }
    assert_eq!(folds.len(), 24);

    let whole = j.path("whole.csv");
    let files = |class: &'static str| {
        (0..8).map(move |n| format!("audio/{class}/{class}{n}.wav,{class}\n"))
    };
    let lines: String = CLASSES.into_iter().flat_map(files).collect();
    std::fs::write(&whole, format!("path;class\n{}", lines.replace(',', ";"))).unwrap();
    done(&["extract", text(&whole), "-o", text(&table), "--preset", "esc26", "-q", "--overwrite"]);
    done(&[&validate[..], &["-o", text(&held), "--overwrite", "-q"]].concat());
    done(&["score", text(&held), "--labels", text(&whole), "--target", "class"]);
    // A class that no prediction can be.
    std::fs::write(&whole, format!("path,class\n{}", lines.replacen(",rain", ",Rain", 2))).unwrap();
    let score = run(&["score", text(&held), "--labels", text(&whole), "--target", "class"]);
    let message = String::from_utf8_lossy(&score.stderr).into_owned();
    assert!(
        message.contains("\"Rain\"") && message.contains("did you mean \"rain\"?"),
        "{message}"
    );
}

/// A model that reads one channel was trained on one channel of recordings of a certain number.
#[test]
fn other_numbers_of_channels_are_refused_where_one_is_read() {
    let j = Journey::begin();
    std::fs::remove_file(j.path("audio/hum/broken.wav")).unwrap();
    let (table, model) = (j.path("table.npz"), j.path("a.model"));
    let set = ["--preset", "esc26", "--set", "signal.channels=[0]", "-q"];
    done(&[&["extract", text(&j.path("audio")), "-o", text(&table)], &set[..]].concat());
    done(&["train", text(&table), "--labels", "folders", "-q", "-o", text(&model)]);
    let stereo = j.path("stereo.wav");
    let spec = hound::WavSpec {
        channels: 2,
        sample_rate: RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(&stereo, spec).unwrap();
    sound("hum", 1).into_iter().flat_map(|s| [s, 0]).for_each(|s| writer.write_sample(s).unwrap());
    writer.finalize().unwrap();
    let classify = ["classify", "-m", text(&model), text(&stereo)];
    let refused = run(&classify);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{message}");
    assert!(
        message.contains("2 channels; the model was trained on recordings of 1 channel:"),
        "{message}"
    );
    assert!(String::from_utf8_lossy(&refused.stdout).contains(",mismatch,"));
    done(&[&classify[..], &["--set", "signal.channels=mean"]].concat());
    done(&[&classify[..], &["--any-rate"]].concat());
    let shown = done(&["inspect", text(&model)]);
    assert!(shown.contains("recordings     16000 Hz, 1 channel, 1.5 s\n"), "{shown}");
}
