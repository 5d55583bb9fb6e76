//! `classify` over windows: live streams, files, votes.

mod votes;

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

#[cfg(target_os = "linux")]
use crate::command::peak_memory;
use crate::command::{done, refused, run, text, tool};

const RATE: usize = 8000;

/// One second of a tone (even seconds) or of noise (odd ones), 16 bits.
fn second(number: usize) -> Vec<i16> {
    let sample = |i: usize| match number % 2 {
        0 => ((i as f64 * 0.35).sin() * 8000.0) as i16,
        _ => {
            ((i as u32).wrapping_mul(2_654_435_761).wrapping_add(number as u32) >> 19) as i16 - 4096
        }
    };
    (0..RATE).map(sample).collect()
}

fn recording(path: &Path, seconds: &[usize]) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE as u32,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for sample in seconds.iter().flat_map(|&s| second(s)) {
        writer.write_sample(sample).unwrap();
    }
    writer.finalize().unwrap();
}

/// Header of a WAV stream of unknown length.
fn header() -> Vec<u8> {
    let mut bytes = b"RIFF\xff\xff\xff\xffWAVEfmt \x10\0\0\0\x01\0\x01\0".to_vec();
    bytes.extend((RATE as u32).to_le_bytes());
    bytes.extend((2 * RATE as u32).to_le_bytes());
    bytes.extend(b"\x02\0\x10\0data\xff\xff\xff\xff");
    bytes
}

fn pcm(samples: &[i16]) -> Vec<u8> {
    samples.iter().flat_map(|s| s.to_le_bytes()).collect()
}

/// A model that tells tones from noise by windows of a second.
struct Trained {
    folder: tempfile::TempDir,
}

impl Trained {
    fn new(classifier: &[&str]) -> Self {
        let this = Self { folder: tempfile::tempdir().unwrap() };
        std::fs::create_dir(this.path("train")).unwrap();
        let mut list = String::from("path,kind\n");
        for number in 0..12 {
            let path = this.path(&format!("train/{number}.wav"));
            recording(&path, &[number]);
            list += &format!("{},{}\n", path.display(), ["tone", "noise"][number % 2]);
        }
        std::fs::write(this.path("list.csv"), list).unwrap();
        let (list, feats, model) = (this.path("list.csv"), this.path("f.npz"), this.path("m"));
        done(&["extract", "--in", text(&list), "--out", text(&feats), "--preset", "esc26", "-q"]);
        let learn =
            ["train", "--features", text(&feats), "--target", "kind", "--out", text(&model)];
        done(&[&learn[..], &["--standardize", "-q"], classifier].concat());
        this
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

#[test]
fn a_line_comes_as_soon_as_its_window_is_complete() {
    let trained = Trained::new(&["--classifier", "knn", "--set", "k=3"]);
    let model = trained.path("m");
    let live = ["classify", "--model", text(&model), "--in", "-", "--window", "1", "--hop", "1"];
    let mut child = tool()
        .args([&live[..], &["--format", "jsonl", "-q"]].concat())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let (send, lines) = std::sync::mpsc::channel();
    let stdout = BufReader::new(child.stdout.take().unwrap());
    let reader = std::thread::spawn(move || {
        for line in stdout.lines() {
            send.send(line.unwrap()).unwrap();
        }
    });
    stdin.write_all(&header()).unwrap();
    for number in 0..4 {
        // All but the last sample of the window: nothing can come yet.
        let bytes = pcm(&second(number));
        let (most, last) = bytes.split_at(bytes.len() - 2);
        for part in most.chunks(3000) {
            stdin.write_all(part).unwrap();
        }
        stdin.flush().unwrap();
        assert!(lines.recv_timeout(Duration::from_millis(200)).is_err(), "a line came too early");
        stdin.write_all(last).unwrap();
        stdin.flush().unwrap();
        let line =
            lines.recv_timeout(Duration::from_secs(60)).expect("a line while the pipe is open");
        let line: Value = serde_json::from_str(&line).unwrap();
        assert_eq!(line["predicted"], ["tone", "noise"][number % 2], "{line}");
        assert_eq!(line["start"].as_f64(), Some(number as f64));
        assert_eq!(line["end"].as_f64(), Some(number as f64 + 1.0));
        let sum: f64 =
            line["probabilities"].as_object().unwrap().values().map(|p| p.as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-9);
    }
    drop(stdin);
    assert!(child.wait().unwrap().success());
    reader.join().unwrap();
    assert!(lines.recv().is_err(), "four windows, four lines");
}

/// A stream that the user ends: the lines so far are in the file.
#[cfg(unix)]
#[test]
fn an_interrupted_stream_keeps_its_lines() {
    let trained = Trained::new(&["--classifier", "knn"]);
    let (model, out) = (trained.path("m"), trained.path("live.csv"));
    let live = ["classify", "--model", text(&model), "--in", "-", "--window", "1", "--hop", "1"];
    let mut child = tool()
        .args([&live[..], &["--out", text(&out)]].concat())
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(&header()).unwrap();
    for number in 0..8 {
        stdin.write_all(&pcm(&second(number))).unwrap();
    }
    let begun = || {
        let entries = std::fs::read_dir(trained.folder.path()).unwrap().map(|e| e.unwrap());
        let mut parts =
            entries.filter(|e| e.file_name().to_string_lossy().starts_with(".live.csv"));
        parts.any(|e| e.metadata().unwrap().len() > 0)
    };
    for _ in 0..600 {
        if begun() {
            break;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    assert!(!out.exists(), "not under its name before it is whole");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    std::thread::sleep(Duration::from_millis(300));
    drop(stdin);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let table = std::fs::read_to_string(&out).unwrap();
    assert!((2..=9).contains(&table.lines().count()), "{table}");
    assert!(table.starts_with("id,path,start,end,status,predicted"));
}

/// A pipe that stays open and says nothing cannot hold up the end.
#[cfg(unix)]
#[test]
fn an_interrupt_is_heard_while_the_stream_is_silent() {
    let trained = Trained::new(&["--classifier", "knn"]);
    let model = trained.path("m");
    let live = ["classify", "--model", text(&model), "--in", "-", "--window", "1", "--hop", "1"];
    let mut child = tool().args(live).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(&header()).unwrap();
    stdin.write_all(&pcm(&second(0))).unwrap();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    let mut lines = [String::new(), String::new()];
    lines.iter_mut().for_each(|line| assert!(stdout.read_line(line).unwrap() > 0));
    assert!(lines[1].contains(",0,1,ok,tone,"), "{lines:?}");
    assert_eq!(crate::command::interrupt(&mut child), Some(130), "its input is still open");
    drop(stdin);
    let mut rest = String::new();
    stdout.read_to_string(&mut rest).unwrap();
    assert_eq!(rest, "", "no window was complete");
}

/// Eight minutes of eight channels, 339 MB, through a process of less than a third of that.
#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_the_stream() {
    let trained = Trained::new(&["--classifier", "knn"]);
    let model = trained.path("m");
    let live = ["classify", "--model", text(&model), "--in", "-", "--window", "1", "--hop", "5"];
    let mut child = tool()
        .args([&live[..], &["-q"]].concat())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let mut stdout = child.stdout.take().unwrap();
    let reader = std::thread::spawn(move || {
        let mut all = String::new();
        stdout.read_to_string(&mut all).unwrap();
        all
    });
    let rate = 44_100_u32;
    let mut head = b"RIFF\0\0\0\0WAVEfmt \x10\0\0\0\x01\0\x08\0".to_vec();
    head.extend(rate.to_le_bytes());
    head.extend((16 * rate).to_le_bytes());
    head.extend(b"\x10\0\x10\0data\0\0\0\0");
    stdin.write_all(&head).unwrap();
    let block = pcm(&(0..8 * rate)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as i16)
        .collect::<Vec<_>>());
    let mut peak = 0;
    for _ in 0..480 {
        stdin.write_all(&block).unwrap();
        peak = peak_memory(&child).unwrap().max(peak);
    }
    drop(stdin);
    assert!(child.wait().unwrap().success());
    assert_eq!(reader.join().unwrap().lines().count(), 1 + 96);
    assert!(peak < 100 << 10, "{peak} KiB");
}

#[test]
fn windows_of_files_are_those_of_a_manifest() {
    let trained = Trained::new(&["--classifier", "rf", "--set", "trees=20"]);
    let (model, audio) = (trained.path("m"), trained.path("audio"));
    std::fs::create_dir(&audio).unwrap();
    recording(&audio.join("a.wav"), &[0, 1, 2, 3]);
    recording(&audio.join("b.wav"), &[1, 1, 1, 0]);
    std::fs::write(audio.join("c.wav"), "RIFF").unwrap();
    let classify = ["classify", "--model", text(&model), "-q", "--in"];
    let output = run(&[&classify[..], &[text(&audio), "--window", "1.5", "--hop", "0.5"]].concat());
    assert_eq!(output.status.code(), Some(1), "c.wav cannot be read");
    let windows = String::from_utf8(output.stdout).unwrap();
    let rows: Vec<Vec<&str>> = windows.lines().map(|l| l.split(',').collect()).collect();
    assert_eq!(rows[0][..6], ["id", "path", "start", "end", "status", "predicted"]);
    assert_eq!(rows.len(), 1 + 6 + 6 + 1);
    assert_eq!(rows[2][..5], ["a", text(&audio.join("a.wav")), "0.5", "2", "ok"]);
    assert_eq!(rows[13][2..5], ["", "", "corrupt"]);

    let mut list = String::from("path,id,start,end\n");
    for row in &rows[1..13] {
        list += &format!("{},{}@{},{},{}\n", row[1], row[0], row[2], row[2], row[3]);
    }
    let manifest = trained.path("windows.csv");
    std::fs::write(&manifest, list).unwrap();
    let alone = done(&[&classify[..], &[text(&manifest)]].concat());
    for (line, row) in alone.lines().skip(1).zip(&rows[1..13]) {
        assert_eq!(line.split(',').skip(2).collect::<Vec<_>>(), row[4..]);
    }
    for jobs in ["1", "3"] {
        let again = ["--window", "1.5", "--hop", "0.5", "--jobs", jobs];
        let output = run(&[&classify[..], &[text(&audio)], &again[..]].concat());
        assert_eq!(String::from_utf8(output.stdout).unwrap(), windows);
    }
}

/// A model of windows was applied to whole recordings, and the reverse, without a word.
#[test]
fn lengths_unlike_those_of_the_training_are_said() {
    let trained = Trained::new(&["--classifier", "knn", "--set", "k=1"]);
    let (model, long) = (trained.path("m"), trained.path("long.wav"));
    recording(&long, &[0, 1, 2, 3]);
    let said = |more: &[&str]| {
        let output = run(&[&["classify", "-m", text(&model), "-q"], more].concat());
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let whole = said(&[text(&long)]);
    let expected = "long is 4 s long, but the model was trained on recordings of 1 s:";
    assert!(whole.starts_with("warning: ") && whole.contains(expected), "{whole}");
    let windows = said(&[text(&long), "--window", "3", "--hop", "0.5"]);
    assert!(windows.contains("a window of long is 3 s long, but"), "{windows}");
    assert_eq!(windows.lines().count(), 1, "{windows}");
    // A recording shorter than a window is one window.
    assert_eq!(said(&[text(&trained.path("train/0.wav")), "--window", "30"]), "");
    assert_eq!(said(&[text(&trained.path("train/0.wav"))]), "");
    assert_eq!(said(&[text(&long), "--window", "1"]), "");
    let inspected = done(&["inspect", text(&model)]);
    assert!(inspected.contains("Hz, 1 channel, 1 s"), "{inspected}");
}

/// Features that leave out the beginning of a recording left out that of each window, without a word.
#[test]
fn cropped_windows_are_said() {
    let trained = Trained::new(&["--classifier", "knn", "--set", "k=1"]);
    let (feats, model) = (trained.path("c.npz"), trained.path("c"));
    let said = |keys: &[&str], window: &str| {
        let list = trained.path("list.csv");
        let keys: Vec<&str> = keys.iter().flat_map(|key| ["--set", key]).collect();
        let extract =
            ["extract", text(&list), "-o", text(&feats), "--preset", "esc26", "-q", "--overwrite"];
        done(&[&extract[..], &keys].concat());
        let learn =
            ["train", text(&feats), "--target", "kind", "-o", text(&model), "-q", "--overwrite"];
        done(&learn);
        let wav = trained.path("train/0.wav");
        let output = run(&["classify", "-m", text(&model), text(&wav), "-q", "--window", window]);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    assert_eq!(said(&[], "1"), "");
    let start = said(&["signal.start=0.25"], "1");
    assert!(
        start.starts_with("warning: signal.start = 0.25: the model's features leave out"),
        "{start}"
    );
    let both = said(&["signal.start=0.25", "signal.end=0.75"], "1");
    assert!(both.contains(": signal.start = 0.25, signal.end = 0.75: "), "{both}");
    assert_eq!(said(&["signal.end=0.75"], "0.5"), "");
}

/// The missing end of a cut file is said where each window has a line of its own, too.
#[test]
fn a_cut_recording_is_said() {
    let trained = Trained::new(&["--classifier", "knn", "--set", "k=1"]);
    let (model, wav) = (trained.path("m"), trained.path("cut.wav"));
    recording(&wav, &[0, 1, 2, 4, 6]);
    let bytes = std::fs::read(&wav).unwrap();
    std::fs::write(&wav, &bytes[..44 + 5 * RATE]).unwrap();
    let windows = ["--window", "1", "--hop", "1"];
    let output =
        run(&[&["classify", "-m", text(&model), "--in", text(&wav)], &windows[..]].concat());
    let table = String::from_utf8(output.stdout).unwrap();
    assert_eq!(table.lines().count(), 3, "{table}");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("cut: truncated: the file ends after "), "{message}");
}

#[test]
fn what_is_no_window_is_refused() {
    let trained = Trained::new(&["--classifier", "knn"]);
    let (model, feats) = (trained.path("m"), trained.path("f.npz"));
    let wav = trained.path("train/0.wav");
    let by = |extra: &[&str]| refused(&[&["classify", "--model", text(&model)], extra].concat());
    let file = ["--in", text(&wav)];
    for (extra, message) in [
        (&["--window", "0"][..], "--window and --hop must be 0.01 to 600 seconds, not 0 and 0"),
        (&["--window", "NaN"], "0.01 to 600 seconds"),
        (&["--window", "1", "--hop", "700"], "not 1 and 700"),
        (&["--vote", "majority"], "--vote needs --window"),
        (
            &["--window", "1", "--vote", "mean", "--background", "tone"],
            "--background needs --vote majority",
        ),
        (&["--window", "1", "--vote", "majority", "--background", "tea"], "no label tea"),
        (&["--hop", "1"], "--window"),
    ] {
        let found = by(&[&file[..], extra].concat());
        assert!(found.contains(message), "{found}");
    }
    assert!(by(&["--features", text(&feats), "--window", "1"]).contains("--window"));

    // A silent file too short for anything, and one that is not audio: lines with a reason.
    let odd = trained.path("odd");
    std::fs::create_dir(&odd).unwrap();
    recording(&odd.join("empty.wav"), &[]);
    recording(&odd.join("good.wav"), &[0]);
    let out = trained.path("out.csv");
    let output = run(&[
        "classify",
        "--model",
        text(&model),
        "--in",
        text(&odd),
        "--window",
        "1",
        "--out",
        text(&out),
    ]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("empty: empty: no samples"));
    assert!(message.contains("1 prediction of kind, 1 failed"), "{message}");
    let table = std::fs::read_to_string(&out).unwrap();
    assert_eq!(table.lines().count(), 3);
    assert!(table.lines().nth(1).unwrap().ends_with(",,,empty,,,"), "{table}");
}
