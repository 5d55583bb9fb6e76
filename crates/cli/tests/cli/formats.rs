//! A model is applied to recordings like those that it was trained on, and to no others in silence.

use std::path::{Path, PathBuf};

use corsmal_files::npz::{Compression, NpzWriter};

use crate::command::{done, refused, run, text};

/// A tone of half a second; class `low` or `high` by its frequency.
fn tone(path: &Path, rate: u32, channels: u16, frequency: f32) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let spec = hound::WavSpec {
        channels,
        sample_rate: rate,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for n in 0..rate / 2 {
        let phase = std::f32::consts::TAU * frequency * n as f32 / rate as f32;
        for _ in 0..channels {
            writer.write_sample((8000.0 * phase.sin()) as i16).unwrap();
        }
    }
    writer.finalize().unwrap();
}

struct Tones {
    folder: tempfile::TempDir,
}

impl Tones {
    /// Sixteen recordings of 44,100 Hz in class folders, their features and a model of them.
    fn new() -> Self {
        let this = Self { folder: tempfile::tempdir().unwrap() };
        for n in 0..8 {
            let step = 10.0 * n as f32;
            tone(&this.path(&format!("data/low/{n}.wav")), 44_100, 1, 300.0 + step);
            tone(&this.path(&format!("data/high/{n}.wav")), 44_100, 1, 3000.0 + step);
        }
        let (data, feats) = (this.path("data"), this.path("feats.npz"));
        let extract = ["extract", "--in", text(&data), "--out", text(&feats)];
        done(&[&extract[..], &["--preset", "mfcc-zcr", "-q"]].concat());
        let model = this.path("m.model");
        let trained = done(&["train", text(&feats), "--labels", "folders", "-o", text(&model)]);
        assert!(trained.contains("class: high (8), low (8)"), "{trained}");
        assert!(trained.contains("next: corsmal-feat classify"), "{trained}");
        this
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Exit code, standard output, standard error.
    fn classify(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        let model = self.path("m.model");
        let output = run(&[&["classify", "-m", text(&model)], arguments].concat());
        let stdout = String::from_utf8(output.stdout).unwrap();
        (output.status.code(), stdout, String::from_utf8(output.stderr).unwrap())
    }
}

/// 80.00 % accuracy became 48.75 % at exit 0: a model trained on 44,100 Hz heard 22,050 Hz.
#[test]
fn recordings_of_another_rate_or_channel_count_are_rows_without_prediction() {
    let t = Tones::new();
    let (alike, slow, stereo) =
        (t.path("a/alike.wav"), t.path("a/slow.wav"), t.path("a/0stereo.wav"));
    tone(&alike, 44_100, 1, 320.0);
    tone(&slow, 22_050, 1, 320.0);
    tone(&stereo, 44_100, 2, 320.0);
    let folder = t.path("a");
    for window in [&[][..], &["--window", "0.4", "--vote", "majority"]] {
        let (code, lines, told) = t.classify(&[&[text(&folder)], window].concat());
        assert_eq!(code, Some(1), "{told}");
        let line = |name: &str| lines.lines().find(|l| l.starts_with(name)).unwrap();
        assert!(line("alike,").contains(",ok,"), "{lines}");
        assert!(line("slow,").contains(",mismatch,"), "{lines}");
        assert!(
            line("0stereo,").contains(",mismatch,"),
            "one odd file never drops the rest: {lines}"
        );
        for part in [
            "22,050 Hz; the model was trained on 44,100 Hz",
            "--set signal.sample_rate=44100",
            "--any-rate",
            "2 channels; the model was trained on recordings of 1",
        ] {
            assert!(told.contains(part), "{part}: {told}");
        }
        assert!(!told.contains("features.npz"), "no temporary file: {told}");
    }

    let (code, lines, told) = t.classify(&[text(&slow), "--set", "signal.sample_rate=44100"]);
    assert_eq!((code, lines.contains(",ok,low,")), (Some(0), true), "{lines}{told}");
    assert_eq!(t.classify(&[text(&slow), "--any-rate"]).0, Some(0));
    // Most of these have two channels, and took the prediction of the one that fits.
    let second = t.path("1stereo.wav");
    tone(&second, 44_100, 2, 320.0);
    let (code, lines, told) =
        t.classify(&[text(&stereo), text(&second), text(&slow), "--any-rate"]);
    assert_eq!((code, lines.matches(",mismatch,").count()), (Some(1), 2), "{lines}{told}");
    assert!(lines.contains("slow.wav,ok,low,"), "{lines}{told}");
    let (code, _, told) = t.classify(&[text(&slow), "--set", "signal.sample_rate=16000"]);
    assert_eq!(code, Some(2));
    assert!(told.contains("signal.sample_rate must be 44,100 Hz, as in training"), "{told}");
    let (code, _, told) = t.classify(&[text(&slow), "--set", "mfcc.n_mfcc=3"]);
    assert_eq!(code, Some(2));
    assert!(told.contains("the model's features are fixed"), "{told}");

    // The same rows as features.
    let feats = t.path("slow.npz");
    let extract = ["extract", "--in", text(&slow), "--out", text(&feats)];
    done(&[&extract[..], &["--preset", "mfcc-zcr", "-q"]].concat());
    let (code, lines, told) = t.classify(&["--features", text(&feats)]);
    assert_eq!((code, lines.contains(",mismatch,")), (Some(1), true), "{told}");
    assert_eq!(t.classify(&["--features", text(&feats), "--any-rate"]).0, Some(0));
}

/// Written by version 0.1.0 from the features of tones of 44,100 Hz.
#[test]
fn a_model_of_version_0_1_0_needs_any_rate_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let wav = folder.path().join("x.wav");
    tone(&wav, 44_100, 1, 320.0);
    let old = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cli/samples/v0.1.0.model");
    let found = refused(&["classify", "-m", old, text(&wav)]);
    assert!(found.contains("does not record the sample rates"), "{found}");
    assert!(found.contains("--any-rate"), "{found}");
    let predicted = done(&["classify", "-m", old, text(&wav), "--any-rate"]);
    assert!(predicted.contains(",ok,low,"), "{predicted}");
}

/// Labels of a manifest are carried, the one that the model predicts as `true`.
#[test]
fn labels_of_a_manifest_reach_the_score() {
    let t = Tones::new();
    let manifest = t.path("list.csv");
    let mut lines = String::from("path,class,site\n");
    for n in 0..4 {
        for (class, site) in [("low", "A"), ("high", "B")] {
            lines += &format!("data/{class}/{n}.wav,{class},{site}\n");
        }
    }
    std::fs::write(&manifest, lines).unwrap();
    let out = t.path("p.csv");
    let (code, _, told) = t.classify(&[text(&manifest), "-o", text(&out)]);
    assert_eq!(code, Some(0), "{told}");
    let written = std::fs::read_to_string(&out).unwrap();
    assert!(written.starts_with("id,path,status,true,site,predicted,p_high,p_low\n"), "{written}");
    let scored = done(&["score", text(&out), "--json"]);
    let scored: serde_json::Value = serde_json::from_str(&scored).unwrap();
    assert_eq!((&scored["rows"], &scored["scores"]["accuracy"]), (&8.into(), &1.0.into()));
    // JSON has them too, and rejected predictions are unknown.
    let (_, lines, told) = t.classify(&[text(&manifest), "--json", "--reject", "1"]);
    assert!(lines.lines().all(|line| line.contains("\"site\":")), "{lines}");
    let unknown = lines.lines().filter(|line| line.contains("\"predicted\":\"unknown\"")).count();
    if unknown > 0 {
        assert!(told.contains(&format!("{unknown} of them unknown")), "{told}");
    }
}

/// As pandas and polars leave it: the same columns, without what `extract` says of them.
#[test]
fn a_table_that_another_tool_wrote_is_trained_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut manifest = "path,kind,take\n".to_string();
    for n in 0..6 {
        let (low, high) = (path(&format!("low{n}.wav")), path(&format!("high{n}.wav")));
        tone(&low, 16_000, 1, 300.0 + 10.0 * n as f32);
        tone(&high, 16_000, 1, 3000.0 + 10.0 * n as f32);
        manifest += &format!("low{n}.wav,low,{n}\nhigh{n}.wav,high,{n}\n");
    }
    let (list, ours, other) = (path("list.csv"), path("ours.parquet"), path("other.parquet"));
    std::fs::write(&list, manifest).unwrap();
    done(&["extract", "--in", text(&list), "--out", text(&ours), "--preset", "mfcc-zcr", "-q"]);
    let mut bytes = std::fs::read(&ours).unwrap();
    let (mark, writer) = (b"corsmal-feat", b"parquet-cpp-");
    let places: Vec<usize> =
        bytes.windows(mark.len()).enumerate().filter(|(_, w)| w == mark).map(|(i, _)| i).collect();
    for at in places {
        bytes[at..at + mark.len()].copy_from_slice(writer);
    }
    std::fs::write(&other, bytes).unwrap();
    let model = path("m.model");
    let train = ["train", text(&other), "--target", "kind", "-o", text(&model)];
    let trained = done(&[&train[..], &["--classifier", "knn"]].concat());
    assert!(trained.contains("kind: high (6), low (6)"), "{trained}");
    let found = done(&["inspect", text(&other)]);
    assert!(found.contains("kind") && found.contains("mfcc[0].mean"), "{found}");
    let none = path("none.model");
    let refusal = refused(&["train", text(&other), "--target", "sort", "-o", text(&none)]);
    assert!(refusal.contains("kind"), "{refusal}");
}

/// Rows of one name would be taken for each other.
#[test]
fn a_parquet_table_whose_ids_come_twice_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut manifest = "path,kind,kx\n".to_string();
    for n in 0..6 {
        tone(&path(&format!("{n}.wav")), 16_000, 1, 300.0 + 500.0 * n as f32);
        manifest += &format!("{n}.wav,{},r{}\n", ["low", "high"][n / 3], n % 5);
    }
    let (list, ours, other) = (path("list.csv"), path("ours.parquet"), path("other.parquet"));
    std::fs::write(&list, manifest).unwrap();
    done(&["extract", "--in", text(&list), "--out", text(&ours), "--preset", "mfcc-zcr", "-q"]);
    let mut bytes = std::fs::read(&ours).unwrap();
    // As another program writes it, with the column kx as id: the length of a name stands before it.
    for (mark, by) in [
        (&b"corsmal-feat"[..], &b"parquet-cpp-"[..]),
        (b"\x02id", b"\x02iq"),
        (b"\x02kx", b"\x02id"),
    ] {
        let found = bytes.windows(mark.len()).enumerate().filter(|(_, window)| *window == mark);
        let places: Vec<usize> = found.map(|(at, _)| at).collect();
        assert!(!places.is_empty());
        places.iter().for_each(|at| bytes[*at..at + mark.len()].copy_from_slice(by));
    }
    std::fs::write(&other, bytes).unwrap();
    let model = path("m.model");
    let learn = [text(&other), "--target", "kind", "--classifier", "knn"];
    for words in [&["train", "-o", text(&model)][..], &["cross-validate", "--cv", "2"]] {
        let refusal = refused(&[words, &learn].concat());
        assert!(refusal.contains("other.parquet: id \"r0\" occurs twice"), "{refusal}");
    }
    assert!(!model.exists());
}

/// Nothing tells whether the columns of such a table are those of the training.
#[test]
fn features_without_names_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let table = |name: &str, names: &[&str]| {
        let path = folder.path().join(name);
        let x: Vec<f32> = (0..40).map(|i| (i * i % 7) as f32).collect();
        let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
        npz.floats("X", &[20, 2], &x).unwrap();
        npz.strings("class", &["a", "b"].repeat(10)).unwrap();
        if !names.is_empty() {
            npz.strings("feature_names", names).unwrap();
        }
        npz.finish().unwrap();
        path
    };
    let (named, bare) = (table("named.npz", &["low", "high"]), table("bare.npz", &[]));
    let model = folder.path().join("a.model");
    done(&["train", text(&named), "--target", "class", "-q", "-o", text(&model)]);
    let classify = |path: &Path| {
        let out = run(&["classify", "-m", text(&model), "--features", text(path), "-q", "-o", "-"]);
        assert!(out.status.success(), "{out:?}");
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    assert!(!classify(&named).contains("does not name its features"));
    let told = classify(&bare);
    assert!(
        told.contains("bare.npz: it does not name its features")
            && told.contains("from low to high")
    );
    let reversed = table("reversed.npz", &["high", "low"]);
    let told = refused(&["classify", "-m", text(&model), "--features", text(&reversed), "-o", "-"]);
    assert!(told.contains("feature 0 must be low, as in training, not high"), "{told}");
}
