//! Networks that learn from recordings and hear them, whole, in windows and live.

use std::path::Path;

use serde_json::Value;

use crate::command::{done, refused, run, text, tool};

/// A second of eight channels: a tone, or noise.
pub fn tone(path: &Path, class: usize, seconds: f64, rate: u32) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let spec = hound::WavSpec {
        channels: 8,
        sample_rate: rate,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    let frames = (seconds * f64::from(rate)) as u32;
    for i in 0..8 * frames {
        let noise = f64::from(i.wrapping_mul(2_654_435_761) >> 16) - 32_768.0;
        let sine = 20_000.0 * (f64::from(i / 8) * 0.05).sin();
        writer.write_sample(if class == 0 { sine } else { noise * 0.5 } as i16).unwrap();
    }
    writer.finalize().unwrap();
}

#[test]
fn a_network_learns_from_recordings_and_hears_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let audio = path("audio");
    for (class, name) in ["tone", "noise"].iter().enumerate() {
        for take in 0..3 {
            tone(&audio.join(name).join(format!("{take}.wav")), class, 1.0, 44_100);
        }
    }
    // Too short for a window of 64 frames.
    tone(&audio.join("tone/short.wav"), 0, 0.3, 44_100);
    tone(&audio.join("noise/short.wav"), 1, 0.25, 44_100);
    // A header that was never completed.
    let unfinished = audio.join("noise/2.wav");
    let mut bytes = std::fs::read(&unfinished).unwrap();
    let data = bytes.windows(4).position(|word| word == b"data").unwrap();
    bytes[data + 4..data + 8].fill(0);
    std::fs::write(&unfinished, bytes).unwrap();
    let model = path("type.safetensors");
    let learn = ["train", text(&audio), "--net", "m4-type", "--labels", "folders"];
    // Windows of one recording would be on both sides.
    let split = ["--set", "select=split", "-o", "split.model"];
    let refusal = refused(&[&learn[..], &split[..]].concat());
    assert!(refusal.contains("recordings have several windows"), "{refusal}");
    let recipe = ["--set", "epochs=4", "--set", "batch=6", "--set", "lr=0.001", "-o", text(&model)];
    let output = run(&[&learn[..], &recipe[..]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    let told = |words: &str| message.lines().filter(|line| line.contains(words)).count();
    assert_eq!(told("short: too short: "), 1, "{message}");
    assert_eq!(told("1 more left out (too short): tone/short"), 1, "{message}");
    assert!(message.contains("warning: recordings: 1 repaired: 1 data_size_zero"), "{message}");

    // A line for each window of a recording, and the reason for the one that has none.
    let classify = ["classify", "-m", text(&model), text(&audio)];
    let output = run(&classify);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("warning: recordings: 1 repaired: 1 data_size_zero"), "{message}");
    let table = String::from_utf8(output.stdout).unwrap();
    let of = |id: &str| table.lines().filter(|l| l.starts_with(&format!("{id},"))).count();
    assert_eq!((of("tone/0"), of("noise/2"), of("tone/short")), (3, 3, 1), "{table}");
    let first = table.lines().find(|l| l.starts_with("tone/0,")).unwrap();
    assert!(first.contains(",0,0.64,") || first.contains(",0.0,0.64,"), "{first}");
    assert!(table.contains("too_short"), "{table}");

    // One decision for each, by their votes; right, since the network was trained on them.
    let votes = run(&[&classify[..], &["--vote", "majority"]].concat());
    let votes = String::from_utf8(votes.stdout).unwrap();
    assert_eq!(votes.lines().count(), 9, "{votes}");

    // A stream, window by window as it comes.
    let wav = audio.join("noise/1.wav");
    let live = ["classify", "-m", text(&model), "-", "--window", "0.7", "--hop", "0.1"];
    let stdin = std::fs::File::open(&wav).unwrap();
    let output = tool().args(live).stdin(stdin).output().unwrap();
    let live = String::from_utf8(output.stdout).unwrap();
    assert_eq!(live.lines().count(), 5, "{live}");

    // A vote is one over the windows that were asked for, not over those inside of them.
    let windows = path("windows.csv");
    let long = ["--window", "0.9", "--hop", "0.1", "-q"];
    run(&[&classify[..], &long, &["-o", text(&windows)]].concat());
    let outcome = |table: &str| -> Vec<Vec<String>> {
        let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let wanted = ["id", "predicted", "p_noise", "p_tone"];
        let place = |name: &str| head.iter().position(|column| *column == name);
        let at = wanted.map(|name| place(name).unwrap_or_else(|| panic!("{name}: {table}")));
        lines.map(|line| at.iter().map(|&at| line[at].to_string()).collect()).collect()
    };
    let voted = run(&[&classify[..], &long, &["--vote", "majority"]].concat());
    let voted = String::from_utf8(voted.stdout).unwrap();
    assert_eq!(voted.matches(",ok,2,").count(), 6, "two windows in a second: {voted}");
    let voted = outcome(&voted);
    let fused = run(&["fuse", text(&windows), "--vote", "majority", "-o", "-"]);
    let fused = outcome(&String::from_utf8(fused.stdout).unwrap());
    assert_eq!(fused, voted);

    // What is missing at the end of a file is said, for windows of either kind and for votes.
    let cut = path("cut.wav");
    let bytes = std::fs::read(&wav).unwrap();
    std::fs::write(&cut, &bytes[..bytes.len() - bytes.len() / 20]).unwrap();
    let classify = ["classify", "-m", text(&model), text(&cut)];
    let windows = ["--window", "0.7", "--hop", "0.1"];
    for more in [&windows[..], &[&windows[..], &["--vote", "majority"]].concat(), &[]] {
        let output = run(&[&classify[..], more].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        let table = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{more:?}: {message}");
        // Windows that end before what is missing are whole.
        let is_cut = table.contains(",truncated,");
        assert_eq!(is_cut, more != windows, "{more:?}: {table}");
        if !more.is_empty() {
            let warned = "warning: cut: truncated: the file ends after ";
            assert_eq!(message.matches(warned).count(), 1, "{more:?}: {message}");
        }
    }

    // Other formats are refused file by file.
    let other = path("other.wav");
    tone(&other, 0, 1.0, 22_050);
    let output = run(&["classify", "-m", text(&model), text(&other)]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("22,050 Hz; the model was trained on 44,100 Hz"), "{message}");
    let message = refused(&[
        "classify",
        "-m",
        text(&model),
        text(&other),
        "--set",
        "signal.sample_rate=8000",
    ]);
    assert!(message.contains("must be 44,100 Hz, as in training"), "{message}");

    let report = done(
        &[
            &["cross-validate"],
            &learn[1..],
            &["--cv", "3", "--set", "epochs=1", "--set", "batch=6", "-q", "--json"],
        ]
        .concat(),
    );
    let report: Value = serde_json::from_str(&report).unwrap();
    let rows: usize = report["result"]["folds"]
        .as_array()
        .unwrap()
        .iter()
        .map(|fold| fold["rows"].as_array().unwrap().len())
        .sum();
    assert_eq!(rows, 6);
    let level = ["train", text(&audio), "--net", "m4-level", "--labels", "folders"];
    let message = refused(&[&level[..], &["-o", text(&path("no.safetensors"))]].concat());
    assert!(message.contains("takes m4_type's features of each window"), "{message}");
}

/// Networks whose features keep the rate of recordings learned of both, without a word.
#[test]
fn recordings_of_several_rates_are_said_to_differ() {
    let folder = tempfile::tempdir().unwrap();
    let audio = folder.path().join("audio");
    for (class, name) in ["tone", "noise"].into_iter().enumerate() {
        for (take, rate) in [44_100, 22_050, 44_100].into_iter().enumerate() {
            tone(&audio.join(name).join(format!("{take}.wav")), class, 1.0, rate);
        }
    }
    let model = folder.path().join("m.safetensors");
    for (net, differ) in [("m1", true), ("mel-cnn", false)] {
        let learn = ["train", text(&audio), "--net", net, "--labels", "folders", "--overwrite"];
        let output = run(&[&learn[..], &["--set", "epochs=1", "-o", text(&model)]].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{message}");
        let expected = "have sample rates of 22050, 44100 Hz, so their features differ; resample";
        assert_eq!(message.contains(expected), differ, "{net}: {message}");
    }
    // A field that is damaged, without a hash, took the check of formats with it.
    let bytes = std::fs::read(&model).unwrap();
    let end = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header = std::str::from_utf8(&bytes[8..end]).unwrap();
    let hash = header.find(r#",\"hash\":\""#).unwrap();
    let header = [&header[..hash], &header[hash + r#",\"hash\":\"\""#.len() + 64..]].concat();
    let header = header.replace(r#"\"trained_on\":{"#, r#"\"trained_on\":{\"x\":1,"#);
    let damaged = folder.path().join("damaged.safetensors");
    let length = (header.len() as u64).to_le_bytes();
    std::fs::write(&damaged, [&length[..], header.as_bytes(), &bytes[end..]].concat()).unwrap();
    let refusal = refused(&["classify", "-m", text(&damaged), text(&audio), "-o", "-"]);
    assert!(refusal.contains("the model is damaged: trained_on"), "{refusal}");
    let any = ["--any-rate", "--features", text(&damaged), "-o", "-"];
    let refusal = refused(&[&["classify", "-m", text(&model)], &any[..]].concat());
    assert!(refusal.contains("--any-rate is for recordings"), "{refusal}");
    // So are their statistics, wherever something is learned of them.
    let table = folder.path().join("t.npz");
    done(&["extract", text(&audio), "--preset", "mfcc-zcr", "-q", "-o", text(&table)]);
    let out = ["-o", text(&model), "--overwrite"];
    for command in [[&["train"][..], &out].concat(), vec!["cross-validate", "--cv", "2"]] {
        let output = run(&[&command[..], &[text(&table), "--labels", "folders"]].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{message}");
        let expected = "features differ; extract with --set signal.sample_rate=44100 to resample";
        assert!(message.contains(expected), "{command:?}: {message}");
    }
}
