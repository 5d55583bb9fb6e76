//! `corsmal-feat inspect` from outside.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn inspect(args: &[&Path]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_corsmal-feat"));
    command.arg("inspect").args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Four channels: a clipped tone, silence, the first again, another tone with an offset.
fn recording(folder: &Path) -> PathBuf {
    let path = folder.join("four.wav");
    let spec = hound::WavSpec {
        channels: 4,
        sample_rate: 8000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(&path, spec).unwrap();
    for t in 0..8000 {
        let tone = |hz: f32| (std::f32::consts::TAU * hz * t as f32 / 8000.0).sin();
        let clipped = (tone(100.0) * 40_000.0).clamp(-32_768.0, 32_767.0) as i16;
        let offset = (tone(333.0) * 8000.0) as i16 + 3277;
        for sample in [clipped, 0, clipped, offset] {
            writer.write_sample(sample).unwrap();
        }
    }
    writer.finalize().unwrap();
    path
}

#[test]
fn a_sick_recording_is_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let out = inspect(&[&recording(folder.path())]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let report = text(&out.stdout);
    assert!(report.contains("wav pcm_s16le · 4 channels · 8000 Hz · 1.000 s (8000 frames)"));
    let row = |channel: &str| {
        let line = report.lines().find(|l| l.trim_start().starts_with(channel)).unwrap();
        line.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(row("0 ")[6..], ["clipped", "in", "200", "places"]);
    assert_eq!(row("1 ")[1..], ["-inf", "-inf", "0.00000", "0", "100.0%", "dead", "(constant)"]);
    assert!(row("2 ").join(" ").ends_with("same as channel 0"));
    assert_eq!(row("3 ")[3], "0.10001");
    assert!(report.contains("to 1.000 (0 and 2)"));
}

#[test]
fn json_holds_the_same_with_all_correlations() {
    let folder = tempfile::tempdir().unwrap();
    let out = inspect(&[&recording(folder.path()), "--json".as_ref()]);
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(report["status"], "ok");
    assert_eq!((&report["channels"], &report["decoded_frames"]), (&4.into(), &8000.into()));
    let health = &report["health"];
    assert_eq!(health["duplicates"], serde_json::json!([[0, 2]]));
    assert_eq!(health["channels"][1]["dead"], true);
    assert_eq!(health["correlation"].as_array().unwrap().len(), 4);
}

#[test]
fn pictures_by_extension() {
    let folder = tempfile::tempdir().unwrap();
    let wav = recording(folder.path());
    for (name, start) in [("p.png", b"\x89PNG".as_slice()), ("p.SVG", b"<svg")] {
        let picture = folder.path().join(name);
        let out = inspect(&[&wav, "--picture".as_ref(), &picture]);
        assert!(out.status.success(), "{}", text(&out.stderr));
        assert!(std::fs::read(&picture).unwrap().starts_with(start));
    }
    for refused in ["p.gif", "nowhere/p.png"] {
        let out = inspect(&[&wav, "--picture".as_ref(), &folder.path().join(refused)]);
        assert_eq!(out.status.code(), Some(2));
        assert!(out.stdout.is_empty() && text(&out.stderr).contains(refused));
    }
}

#[test]
fn what_is_no_recording_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.wav");
    std::fs::write(&bad, b"RIFF\x04\0\0\0WAVE").unwrap();
    let out = inspect(&[&bad]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("bad.wav: corrupt at byte 12"));
    let out = inspect(&[&bad, "--json".as_ref()]);
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((&report["status"], &report["byte"]), (&"corrupt".into(), &12.into()));

    let missing = inspect(&[&folder.path().join("missing.wav")]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(text(&missing.stderr).contains("missing.wav"));
}
