//! `corsmal-feat inspect` from outside.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::command::tool;

fn inspect(args: &[&Path]) -> Output {
    tool().arg("inspect").args(args).output().unwrap()
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
    assert!(row("3 ").join(" ").ends_with("DC offset +0.10"));
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

/// A recording that `extract` calls truncated was "ok".
#[test]
fn a_recording_that_lacks_samples_is_truncated() {
    let folder = tempfile::tempdir().unwrap();
    let wav = recording(folder.path());
    let bytes = std::fs::read(&wav).unwrap();
    let cut = folder.path().join("cut.wav");
    std::fs::write(&cut, &bytes[..bytes.len() - 5000]).unwrap();
    let out = inspect(&[&cut, "--json".as_ref()]);
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((&report["status"], &report["truncated"]), (&"truncated".into(), &true.into()));
    let out = inspect(&[&wav, &cut, "--json".as_ref()]);
    let lines: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(lines[0]["status"], "ok");
    assert_eq!(lines[1]["status"], "truncated");
    // What `extract` says of others that can be read.
    let float = |name: &str, samples: &[f32]| {
        let path = folder.path().join(name);
        let spec = hound::WavSpec {
            channels: 1,
            sample_rate: 8000,
            bits_per_sample: 32,
            sample_format: hound::SampleFormat::Float,
        };
        let mut writer = hound::WavWriter::create(&path, spec).unwrap();
        samples.iter().for_each(|sample| writer.write_sample(*sample).unwrap());
        writer.finalize().unwrap();
        path
    };
    for (status, samples) in
        [("empty", &[][..]), ("non_finite", &[0.1, f32::NAN]), ("unsupported", &[0.1, 1e13])]
    {
        let path = float(status, samples);
        let report = text(&inspect(&[&path, "--json".as_ref()]).stdout);
        assert!(report.contains(&format!("\"status\": \"{status}\"")), "{report}");
        let told = if status == "non_finite" { "1 sample not finite" } else { status };
        let listed = text(&inspect(&[&wav, &path]).stdout);
        assert!(listed.lines().any(|line| line.ends_with(told)), "{listed}");
    }
    let shown = text(&inspect(&[&wav, &cut]).stdout);
    assert!(shown.lines().any(|line| line.ends_with("; truncated; 1 repaired")), "{shown}");
}

#[test]
fn pictures_by_extension() {
    let folder = tempfile::tempdir().unwrap();
    let wav = recording(folder.path());
    for (name, start) in [("p.png", b"\x89PNG".as_slice()), ("p.SVG", b"<svg"), ("p.pdf", b"%PDF")]
    {
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

/// A text in one line, as it was before it was cut for the terminal.
fn joined(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The SVG that `inspect --picture` draws.
fn drawn(file: &Path, args: &[&str]) -> String {
    let picture = file.with_extension("drawn.svg");
    let mut out = tool();
    let out = out.arg("inspect").arg(file).arg("--picture").arg(&picture).args(args);
    let out = out.arg("--overwrite").output().unwrap();
    assert!(out.status.success(), "{}", text(&out.stderr));
    std::fs::read_to_string(picture).unwrap()
}

#[test]
fn pictures_show_what_is_asked_for_and_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let wav = recording(folder.path());
    let whole = drawn(&wav, &[]);
    for told in ["ch 3", "dead (constant)", "clipped in 200 places", "same as channel 0", ">1k<"] {
        assert!(whole.contains(told), "{told}");
    }
    let part =
        drawn(&wav, &["--channels", "3,1", "--start", "0.25", "--end", "0.5", "--title", "T"]);
    assert!(part.contains("ch 3") && part.contains("ch 1") && !part.contains("ch 2"));
    assert!(part.contains(">T</text>") && part.contains(">0.30<") && !part.contains(">0.6"));
    // A quarter of the clipped places, which are of channel 0.
    let clipped = drawn(&wav, &["--channels", "0", "--start", "0.25", "--end", "0.5"]);
    assert!(clipped.contains("clipped in 50 places"), "the notes are of what is drawn");
    let linear = drawn(&wav, &["--frequency-axis", "linear", "--fmax", "2000"]);
    assert!(linear.contains(">500<") && !linear.contains(">2k<"));
    assert!(drawn(&wav, &["--frequency-axis", "log"]).contains(">200<"));
    assert_ne!(drawn(&wav, &["--wave-scale", "channel"]), whole);
    let png = |dpi: &str| {
        let picture = folder.path().join(format!("p{dpi}.png"));
        let options = ["--picture", "--dpi"].map(Path::new);
        let args: [&Path; 5] = [&wav, options[0], &picture, options[1], Path::new(dpi)];
        assert!(inspect(&args).status.success());
        std::fs::read(picture).unwrap()[16..20].to_vec()
    };
    assert_eq!((png("96"), png("192")), (vec![0, 0, 4, 20], vec![0, 0, 8, 40]));
    for refused in [
        &["--channels", "4"][..],
        &["--start", "2"],
        &["--start", "0.5", "--end", "0.5"],
        &["--channels", "x"],
        &["--dpi", "5"],
    ] {
        let picture = folder.path().join("q.svg");
        let mut command = tool();
        command.arg("inspect").arg(&wav).arg("--picture").arg(&picture).args(refused);
        let out = command.output().unwrap();
        assert_eq!(out.status.code(), Some(2), "{refused:?}");
        assert!(text(&out.stderr).contains(refused[0]) && !picture.exists(), "{refused:?}");
    }
}

#[test]
fn folders_and_several_files_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let wav = recording(folder.path());
    let listed = inspect(&[folder.path()]);
    assert!(listed.status.success(), "{}", text(&listed.stderr));
    let shown = text(&listed.stdout);
    assert!(
        shown.contains("1.00 s    8000   4") && shown.contains("ch 1 dead (constant)"),
        "{shown}"
    );
    assert!(shown.contains("1 recording: 1.00 s\n1 at 8000 Hz, 4 channels"), "{shown}");
    let bad = folder.path().join("bad.wav");
    std::fs::write(&bad, b"RIFF").unwrap();
    let both = inspect(&[&wav, &bad]);
    assert_eq!(both.status.code(), Some(1));
    assert!(text(&both.stdout).contains("1 file cannot be read"));
    let json = inspect(&[&wav, &bad, "--json".as_ref()]);
    let lines: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&lines[0]["channels"], &lines[1]["status"]), (&4.into(), &"corrupt".into()));
    let picture = folder.path().join("p.svg");
    let refused = inspect(&[folder.path(), "--picture".as_ref(), &picture]);
    assert!(text(&refused.stderr).contains("name one file") && !picture.exists());
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

/// An output with one good and one bad recording.
fn output(folder: &Path, name: &str) -> PathBuf {
    let audio = folder.join("audio");
    std::fs::create_dir_all(&audio).unwrap();
    recording(&audio);
    std::fs::write(audio.join("bad.wav"), b"RIFF").unwrap();
    let out = folder.join(name);
    let mut command = Command::new(env!("CARGO_BIN_EXE_corsmal-feat"));
    command.arg("extract").arg("--in").arg(audio).arg("--out").arg(&out);
    let run = command.args(["--preset", "mfcc-zcr"]).output().unwrap();
    assert_eq!(run.status.code(), Some(1), "{}", text(&run.stderr));
    out
}

#[test]
fn outputs_show_contents_configuration_and_outcomes() {
    let folder = tempfile::tempdir().unwrap();
    // 4 channels of (20 + 1) features, mean and standard deviation.
    for (name, format, first, shape) in [
        ("feats.npz", "npz", "__ids__", serde_json::json!([1])),
        ("feats.parquet", "parquet", "id", serde_json::json!([1])),
    ] {
        let out = output(folder.path(), name);
        let shown = inspect(&[&out]);
        assert!(shown.status.success(), "{}", text(&shown.stderr));
        let report = text(&shown.stdout);
        for words in [
            "2 inputs: 1 corrupt, 1 ok",
            "rates       8000 Hz × 1\n  channels    4 × 1\n  durations   1.00 s each, 1.00 s in all",
            "  is preset mfcc-zcr\n",
            "audio/bad.wav: corrupt at byte 0",
        ] {
            assert!(joined(&report).contains(&joined(words)), "{words:?} is not in: {report}");
        }
        let shown = inspect(&[&out, "--json".as_ref()]);
        let report: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
        assert_eq!(report["format"], format);
        assert_eq!(
            (&report["members"][0]["name"], &report["members"][0]["shape"]),
            (&first.into(), &shape)
        );
        assert_eq!(report["config"]["features"]["mfcc"]["n_mfcc"], 20);
        assert_eq!(report["rates"], serde_json::json!({"8000": 1}));
        assert_eq!(report["channels"], serde_json::json!({"4": 1}));
        assert_eq!(report["meta"]["shard"], "0/1");
        assert_eq!(report["statuses"], serde_json::json!({"corrupt": 1, "ok": 1}));
        assert_eq!(report["failed"][0]["id"], "bad");
        let table = drawn(&out, &[]);
        assert!(table.contains("recordings: 1, features: 168"), "{table}");
    }
    let members = text(&inspect(&[&folder.path().join("feats.npz")]).stdout);
    assert!(members.contains("1 row × 168 features"), "{members}");
}

#[test]
fn of_other_archives_only_the_members() {
    use corsmal_files::npz::{Compression, NpzWriter};
    let folder = tempfile::tempdir().unwrap();
    let foreign = folder.path().join("foreign.npz");
    let mut writer = NpzWriter::create(&foreign, Compression::Deflated).unwrap();
    writer.floats("x", &[2, 3], &[0.0; 6]).unwrap();
    writer.strings("names", &["one", "three"]).unwrap();
    writer.finish().unwrap();
    let shown = inspect(&[&foreign]);
    let report = text(&shown.stdout);
    assert!(shown.status.success() && report.contains("npz · 2 members"), "{report}");
    let rows: Vec<Vec<&str>> = report.lines().map(|l| l.split_whitespace().collect()).collect();
    assert!(rows.contains(&vec!["x", "<f4", "2", "×", "3"]), "{report}");
    assert!(rows.contains(&vec!["names", "<U5", "2"]), "{report}");
    assert!(!report.contains("configuration"));

    // Torn archives, and a table of someone else.
    let bytes = std::fs::read(&foreign).unwrap();
    for (name, content) in
        [("torn.npz", &bytes[..bytes.len() / 2]), ("torn.parquet", b"PAR1 and no more".as_slice())]
    {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        let out = inspect(&[&path]);
        assert_eq!(out.status.code(), Some(1));
        let message = text(&out.stderr);
        assert!(message.contains(name) && !message.contains("panicked"), "{message}");
        let out = inspect(&[&path, "--json".as_ref()]);
        let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        assert!(report["reason"].as_str().is_some_and(|r| !r.is_empty()));
    }
}

#[test]
fn a_picture_is_replaced_only_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let wav = recording(folder.path());
    let picture = folder.path().join("x.svg");
    std::fs::write(&picture, "mine").unwrap();
    let refused = inspect(&[&wav, "--picture".as_ref(), &picture]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("exists; --overwrite replaces it"));
    assert_eq!(std::fs::read_to_string(&picture).unwrap(), "mine");
}

#[test]
fn a_ledger_says_how_far_its_run_came() {
    let folder = tempfile::tempdir().unwrap();
    let audio = folder.path().join("audio");
    std::fs::create_dir(&audio).unwrap();
    recording(&audio);
    std::fs::write(audio.join("bad.wav"), b"RIFF").unwrap();
    let out = folder.path().join("feats.npz");
    // Ends at the first failure, its ledger intact.
    let mut command = tool();
    command.arg("extract").arg("--in").arg(&audio).arg("--out").arg(&out);
    let run = command.args(["--preset", "mfcc-zcr", "--max-errors", "0"]).output().unwrap();
    assert!(!run.status.success());
    let ledger = folder.path().join("feats.npz.ledger");
    let shown = inspect(&[&ledger]);
    assert!(shown.status.success(), "{}", text(&shown.stderr));
    let report = text(&shown.stdout);
    assert!(
        report.contains("ledger of an unfinished run") && report.contains("shard 0/1"),
        "{report}"
    );
    assert!(report.contains("bad.wav: "), "{report}");
    let json = inspect(&[&ledger, "--json".as_ref()]);
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(
        (&json["kind"], &json["header"]["format"]),
        (&"ledger".into(), &"npz stored".into())
    );
    // A header that was changed is none.
    let bytes = std::fs::read_to_string(&ledger).unwrap();
    std::fs::write(&ledger, bytes.replacen("0/1", "0/2", 1)).unwrap();
    let torn = inspect(&[&ledger]);
    assert_eq!(torn.status.code(), Some(1));
    assert!(text(&torn.stderr).contains("the checksum of its first line does not match"));
}
