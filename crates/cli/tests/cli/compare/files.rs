//! Formats, matching, configurations, and what is refused.

use std::io::Write;
use std::path::Path;
use std::process::Output;

use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzFile, NpzWriter};
use serde_json::{Value, json};

use super::support::{Files, extract, levels, npz, powers, recording, text};
use crate::command::run;

fn kinds(report: &Value, feature: &str) -> Vec<String> {
    let features = report["features"].as_array().unwrap();
    let feature = features.iter().find(|f| f["feature"] == feature).unwrap();
    let causes = feature["causes"].as_array().unwrap();
    causes.iter().map(|c| c["kind"].as_str().unwrap().to_string()).collect()
}

#[test]
fn outputs_are_compared_by_recording_and_feature() {
    let files = Files::new();
    extract(&files, "a.npz", &[]);
    extract(&files, "b.npz", &["--set", "melspectrogram.pad_mode=reflect"]);
    let report = files.json("a.npz", "b.npz", &[]);
    let settings = report["settings"]["differences"].as_array().unwrap();
    let key = "features.melspectrogram.pad_mode";
    assert_eq!(settings, &[json!({"key": key, "a": "constant", "b": "reflect"})]);
    assert_ne!(report["settings"]["hash_a"], report["settings"]["hash_b"]);
    assert_eq!(report["settings"]["same_inputs"], true);
    assert_eq!(kinds(&report, "melspectrogram"), ["edge_frames"]);
    let features = report["features"].as_array().unwrap();
    let names: Vec<&str> = features.iter().map(|f| f["feature"].as_str().unwrap()).collect();
    assert_eq!(names, ["melspectrogram", "frame times"]);
    assert_eq!((&features[0]["arrays"], &features[0]["differing"]), (&json!(2), &json!(2)));
    assert_eq!(features[1]["differing"], 0);
    let shown = text(&files.run("a.npz", "b.npz", &[]).stdout);
    for words in
        ["configuration different, the same inputs", "\"constant\" | \"reflect\"", "channel "]
    {
        assert!(shown.contains(words), "{words:?} is not in: {shown}");
    }
}

#[test]
fn causes_of_real_configurations() {
    let files = Files::new();
    extract(&files, "a.npz", &[]);
    let cause = |set: &str| {
        let out = format!("{set}.npz");
        extract(&files, &out, &["--set", set]);
        let report = files.json("a.npz", &out, &[]);
        let causes = report["features"][0]["causes"].as_array().unwrap().clone();
        let first = causes.first().unwrap_or_else(|| panic!("no cause of {set}: {report:#}"));
        format!("{}: {}", first["kind"].as_str().unwrap(), first["cause"].as_str().unwrap())
    };
    let joint = cause("melspectrogram.joint=true");
    assert!(joint.starts_with("floor: joint") && joint.contains("b clamps 80 dB below"), "{joint}");
    let range = cause("melspectrogram.top_db=40");
    assert!(range.starts_with("floor: another lower limit"), "{range}");
    let center = cause("melspectrogram.center=false");
    assert!(center.starts_with("frames: b begins at frame 2 of the other"), "{center}");
    let norm = cause("melspectrogram.norm=none");
    assert!(norm.contains("norm slaney against none"), "{norm}");
    let linear = cause("melspectrogram.scale=linear");
    assert!(linear.starts_with("transform: decibels of powers"), "{linear}");
    let scale = cause("melspectrogram.htk=true");
    assert!(scale.starts_with("mel_scale: a has Slaney's mel scale, b HTK's"), "{scale}");
}

#[test]
fn tables_of_both_formats() {
    let files = Files::new();
    extract(&files, "a.npz", &["--preset", "mfcc-zcr"]);
    extract(&files, "b.parquet", &["--preset", "mfcc-zcr"]);
    let out = files.run("a.npz", "b.parquet", &[]);
    assert_eq!(out.status.code(), Some(0), "{}{}", text(&out.stdout), text(&out.stderr));
    extract(&files, "c.parquet", &["--preset", "mfcc-zcr", "--set", "mfcc.ref=0.001"]);
    let report = files.json("b.parquet", "c.parquet", &[]);
    let features = report["features"].as_array().unwrap();
    assert_eq!((&features[0]["feature"], &features[0]["differing"]), (&json!("mfcc"), &json!(2)));
    let largest = &features[0]["largest"];
    assert!(largest["position"].as_str().unwrap().contains("mfcc["), "{largest}");
    assert!(["one", "two"].contains(&largest["array"].as_str().unwrap()));
    assert_eq!(features[1]["feature"], "zero_crossing_rate");
    assert_eq!(features[1]["differing"], 0);
}

#[test]
fn arrays_by_map_by_name_and_alone() {
    let files = Files::new();
    npz(&files.path("a.npz"), &[("x", &levels()), ("y", &powers())]);
    npz(&files.path("b.npz"), &[("z", &levels()), ("y", &powers())]);
    let report = files.json("a.npz", "b.npz", &[]);
    assert_eq!((&report["only_a"], &report["only_b"]), (&json!(["x"]), &json!(["z"])));
    assert_eq!(report["within"], false);
    let out = files.run("a.npz", "b.npz", &["--map", "x=z"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stdout));
    let unknown = files.run("a.npz", "b.npz", &["--map", "x=nothing"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(text(&unknown.stderr).contains("no array \"nothing\" to map; there are \"z\", \"y\""));
    assert_eq!(files.run("a.npz", "b.npz", &["--map", "x"]).status.code(), Some(2));

    // The only array of each file needs no name, here a .npy of doubles in Fortran order.
    npz(&files.path("one.npz"), &[("x", &levels())]);
    let values = levels();
    let mut bytes = Header::new(DType::F64, &[3, 40, 60]).fortran().encode();
    let turned = values.view().reversed_axes();
    bytes.extend(turned.iter().flat_map(|&v| f64::from(v).to_ne_bytes()));
    std::fs::write(files.path("other.npy"), bytes).unwrap();
    let report = files.json("one.npz", "other.npy", &[]);
    assert_eq!(report["within"], true, "{report:#}");
    assert_eq!(report["features"][0]["dtypes"], json!(["<f4", "<f8"]));
    assert_eq!(report["features"][0]["equal"], 7200);
}

/// Rounding in another recording was the first cause that was named.
#[test]
fn what_differs_is_explained_before_what_is_rounded() {
    let files = Files::new();
    extract(&files, "a.npz", &["--preset", "logmel"]);
    let mut read = NpzFile::open(&files.path("a.npz")).unwrap();
    let mut writer = NpzWriter::create(&files.path("b.npz"), Compression::Stored).unwrap();
    for (name, change) in [("one", 1e-5), ("two", 3.0)] {
        let values = read.f32(name).unwrap();
        let shape = values.shape().to_vec();
        let values: Vec<f32> = values.iter().map(|v| v + change).collect();
        writer.floats(name, &shape, &values).unwrap();
    }
    writer.finish().unwrap();
    let report = files.json("a.npz", "b.npz", &[]);
    let causes = report["features"][0]["causes"].as_array().unwrap();
    let kinds: Vec<&Value> = causes.iter().map(|cause| &cause["kind"]).collect();
    assert_eq!(kinds, ["offset", "rounding"], "{report:#}");
}

#[test]
fn complex_numbers_are_compared_by_part() {
    let files = Files::new();
    for (name, factor) in [("a.npz", 1.0f32), ("b.npz", 2.0)] {
        let mut writer = NpzWriter::create(&files.path(name), Compression::Stored).unwrap();
        let values: Vec<f32> = (0..480).map(|i| factor * (i as f32 * 0.7).sin()).collect();
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
        writer.array("x", &Header::new(DType::C64, &[12, 20]).fortran(), &bytes).unwrap();
        writer.finish().unwrap();
    }
    let report = files.json("a.npz", "b.npz", &[]);
    assert_eq!(report["features"][0]["values"], 480);
    assert_eq!(report["features"][0]["causes"][0]["kind"], "ratio");
}

#[test]
fn missing_values_are_counted() {
    let (files, mut b) = (Files::new(), levels());
    b[(0, 0, 0)] = f32::NAN;
    b[(1, 2, 3)] = f32::INFINITY;
    npz(&files.path("a.npz"), &[("x", &levels())]);
    npz(&files.path("b.npz"), &[("x", &b)]);
    let report = files.json("a.npz", "b.npz", &[]);
    assert_eq!(report["features"][0]["one_sided"], 2);
    assert_eq!(report["features"][0]["largest"], Value::Null);
    assert_eq!(files.json("b.npz", "b.npz", &[])["within"], true);
}

#[track_caller]
fn refused(out: &Output, words: &[&str]) {
    let message = text(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{message}");
    assert!(out.stdout.is_empty());
    for word in words {
        assert!(message.contains(word), "{word:?} is not in: {message}");
    }
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let files = Files::new();
    npz(&files.path("a.npz"), &[("x", &levels())]);
    refused(&files.run("a.npz", "missing.npz", &[]), &["missing.npz", "No such file"]);
    std::fs::write(files.path("text.npz"), "no archive").unwrap();
    refused(&files.run("text.npz", "a.npz", &[]), &["text.npz", "expected a .npz archive"]);
    let bytes = std::fs::read(files.path("a.npz")).unwrap();
    std::fs::write(files.path("torn.npz"), &bytes[..bytes.len() / 2]).unwrap();
    refused(&files.run("a.npz", "torn.npz", &[]), &["torn.npz", "not a readable npz archive"]);
    std::fs::write(files.path("torn.npy"), Header::new(DType::F32, &[9]).encode()).unwrap();
    refused(&files.run("a.npz", "torn.npy", &[]), &["torn.npy", "36 bytes of data"]);
    npz(&files.path("two.npz"), &[("y", &levels()), ("z", &levels())]);
    let out = files.run("a.npz", "two.npz", &[]);
    refused(&out, &["no numeric arrays in common", "a.npz has \"x\"", "two.npz has \"y\", \"z\""]);
    std::fs::write(files.path("torn.parquet"), b"PAR1 and no more").unwrap();
    refused(&files.run("a.npz", "torn.parquet", &[]), &["torn.parquet"]);
}

/// An array of one Python object as numpy writes it; the pickle itself must never be looked at.
fn pickled() -> Vec<u8> {
    let text = "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }\n";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.extend(b"\x80\x04]\x94.");
    bytes
}

fn archive(path: &Path, members: &[(&str, Vec<u8>)]) {
    let mut writer = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in members {
        let options = zip::write::SimpleFileOptions::default();
        writer.start_file(format!("{name}.npy"), options).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn python_objects_are_never_read() {
    let files = Files::new();
    let mut numbers = Header::new(DType::F32, &[3]).encode();
    numbers.extend([0u8; 12]);
    archive(&files.path("only.npz"), &[("x", pickled())]);
    refused(&files.run("only.npz", "only.npz", &[]), &["no numeric arrays in common"]);
    std::fs::write(files.path("o.npy"), pickled()).unwrap();
    refused(&files.run("o.npy", "only.npz", &[]), &["o.npy", "Python objects (pickle)"]);

    // Beside numbers they are named, and the files do not count as equal.
    archive(&files.path("both.npz"), &[("x", pickled()), ("y", numbers.clone())]);
    let out = files.run("both.npz", "both.npz", &[]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("not compared: x"), "{}", text(&out.stderr));
    // In one file only they concern nobody.
    archive(&files.path("numbers.npz"), &[("y", numbers)]);
    assert_eq!(files.run("both.npz", "numbers.npz", &[]).status.code(), Some(0));
}

#[test]
fn recordings_of_other_folders_are_paired_by_file_name() {
    let files = Files::new();
    extract(&files, "a.npz", &["--preset", "esc26"]);
    let (audio, listed) = (files.path("audio"), files.path("listed.csv"));
    let line =
        |name: &str| format!("take/{name},{}\n", audio.join(format!("{name}.wav")).display());
    std::fs::write(&listed, format!("id,path\n{}{}", line("one"), line("two"))).unwrap();
    let again = |out: &str, more: &[&str]| {
        let (list, out) = (files.path("listed.csv"), files.path(out));
        let args = ["extract", text_of(&list), "-o", text_of(&out), "--preset", "esc26", "-q"];
        assert!(run(&[&args[..], more].concat()).status.success());
    };
    again("b.npz", &[]);
    let out = files.run("a.npz", "b.npz", &[]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("paired by file name"), "{}", text(&out.stdout));

    // Nothing in the values names a cause, so the keys that differ are named.
    again("c.npz", &["--set", "signal.res_type=kaiser_fast", "--set", "mfcc.pad_mode=reflect"]);
    let report = files.json("b.npz", "c.npz", &[]);
    assert_eq!(kinds(&report, "mfcc"), ["configuration"]);
    let shown = text(&files.run("b.npz", "c.npz", &[]).stdout);
    assert!(shown.contains("likely cause: the configuration: signal.res_type, mfcc.pad_mode"));

    // Neither ids nor file names in common: the contents are the same.
    std::fs::write(&listed, format!("id,path\nx,{}\n", audio.join("one.wav").display())).unwrap();
    again("d.npz", &[]);
    let report = files.json("a.npz", "d.npz", &[]);
    assert_eq!((&report["paired_by"], &report["only_a"]), (&json!("content"), &json!(["two"])));
    assert_eq!(report["features"][0]["differing"], 0);
    assert_eq!(report["texts"][0]["values"], 1, "the status of one recording");
    let shown = text(&files.run("d.npz", "a.npz", &[]).stdout);
    assert!(shown.contains("recordings are paired by content"), "{shown}");

    // Nor the contents: the recordings are named, not the columns.
    recording(&files.path("other.wav"), 3);
    let other = files.path("other.wav");
    std::fs::write(&listed, format!("id,path\nx,{}\n", other.display())).unwrap();
    again("f.npz", &[]);
    let words = ["no recording in common", "a.npz has \"one\", \"two\"", "f.npz has \"x\""];
    refused(&files.run("a.npz", "f.npz", &[]), &words);

    // The same recordings, and nothing in common that is known of them.
    extract(&files, "e.npz", &["--preset", "logmel"]);
    let words = ["recordings are the same", "e.npz has \"one\"", "Compare frames with frames"];
    refused(&files.run("a.npz", "e.npz", &[]), &words);
}

fn text_of(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn other_recordings_under_the_same_names_are_a_cause() {
    let files = Files::new();
    let frames = ["--preset", "logmel", "--add", "rms"];
    extract(&files, "a.npz", &frames);
    recording(&files.path("audio/two.wav"), 7);
    extract(&files, "b.npz", &frames);
    let report = files.json("a.npz", "b.npz", &[]);
    let contents = &report["settings"]["contents"];
    assert_eq!((&contents["values"], &contents["differing"]), (&json!(2), &json!(1)));
    assert_eq!(contents["first"]["place"], "two");
    assert_eq!(kinds(&report, "rms"), ["recordings"]);
    let shown = text(&files.run("a.npz", "b.npz", &[]).stdout);
    let words = "1 of 2 paired recordings differ in content; the first is \"two\"";
    assert!(shown.contains(words) && !shown.contains("cause unknown"), "{shown}");

    // Frames of several features under other ids.
    let listed = files.path("listed.csv");
    let line = |name: &str| {
        format!("take/{name},{}\n", files.path(&format!("audio/{name}.wav")).display())
    };
    std::fs::write(&listed, format!("id,path\n{}{}", line("one"), line("two"))).unwrap();
    let out = files.path("c.npz");
    let args = ["extract", text_of(&listed), "-o", text_of(&out), "-q"];
    assert!(run(&[&args[..], &frames].concat()).status.success());
    let report = files.json("b.npz", "c.npz", &[]);
    assert_eq!((&report["paired_by"], &report["within"]), (&json!("file_name"), &json!(true)));
}

#[test]
fn what_is_in_both_files_is_paired_although_other_names_come_twice() {
    let files = Files::new();
    extract(&files, "a.npz", &["--preset", "esc26"]);
    let listed = files.path("listed.csv");
    let (one, two) = (files.path("audio/one.wav"), files.path("audio/two.wav"));
    let rows = format!("id,path\np/one,{0}\nq/one,{0}\nr/two,{1}\n", one.display(), two.display());
    std::fs::write(&listed, rows).unwrap();
    let out = files.path("b.npz");
    let args = ["extract", text_of(&listed), "-o", text_of(&out), "--preset", "esc26", "-q"];
    assert!(run(&args).status.success());
    let report = files.json("a.npz", "b.npz", &[]);
    assert_eq!(report["paired_by"], "file_name");
    assert_eq!(report["features"][0]["arrays"], 1);
    assert_eq!(report["only_b"], json!(["p/one", "q/one"]));

    // Statistics of some of the recordings, frames of all.
    std::fs::write(&listed, format!("id,path\none,{}\nx,{}\n", one.display(), two.display()))
        .unwrap();
    let out = files.path("c.npz");
    let args = ["extract", text_of(&listed), "-o", text_of(&out), "--preset", "logmel", "-q"];
    assert!(run(&args).status.success());
    refused(&files.run("a.npz", "c.npz", &[]), &["recordings are the same", "Compare frames"]);
}

#[test]
fn zeros_and_complex_numbers_have_no_cause_that_is_not_theirs() {
    let files = Files::new();
    let truth = levels().mapv(|v| f32::from(v > -40.0));
    npz(&files.path("a.npz"), &[("x", &truth)]);
    npz(&files.path("b.npz"), &[("x", &truth.mapv(|v| 1.0 - v))]);
    npz(&files.path("c.npz"), &[("x", &truth.mapv(|_| 0.0))]);
    for other in ["b.npz", "c.npz"] {
        let found = kinds(&files.json("a.npz", other, &[]), "x");
        assert!(!found.contains(&"transform".to_owned()), "{other}: {found:?}");
    }

    let complex = ["--preset", "logmel", "--add", "stft", "--set", "stft.output=complex"];
    extract(&files, "d.npz", &complex);
    extract(&files, "e.npz", &[&complex[..], &["--set", "signal.preemphasis=0.5"]].concat());
    let report = files.json("d.npz", "e.npz", &[]);
    let features = report["features"].as_array().unwrap();
    let stft = features.iter().find(|f| f["feature"] == "stft").unwrap();
    assert!(stft["differing"].as_u64().unwrap() > 0);
    let causes = stft["causes"].to_string();
    assert!(causes.len() > 2 && !causes.contains("channel"), "{causes}");
}

#[test]
fn a_projection_keeps_what_there_is_by_default() {
    let files = Files::new();
    extract(&files, "a.npz", &["--preset", "esc26"]);
    let (features, out) = (files.path("a.npz"), files.path("pca.npz"));
    let told = run(&["pca", text_of(&features), "--out", text_of(&out)]);
    let told = text(&told.stdout);
    assert!(told.contains("26 features to 2 components"), "{told}");
}
