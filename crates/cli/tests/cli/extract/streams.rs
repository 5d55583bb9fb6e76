//! Standard input, output and error as shells connect them.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::Stdio;

use corsmal_files::outcome::Status;

use super::support::{Ended, ended, extract, extraction, folder, table, wav};
use crate::command::{text, tool};

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let folder = folder(2000);
    let (audio, out) = (folder.path().join("audio"), folder.path().join("feats.npz"));
    let mut run = extraction(&audio, &out, &["--dry-run"]);
    let mut child = run.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut line = String::new();
    let mut stdout = BufReader::with_capacity(64, child.stdout.take().unwrap());
    stdout.read_line(&mut line).unwrap();
    drop(stdout);
    assert_eq!(line, format!("00/r0000\t{}/00/r0000.wav\n", audio.display()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_cannot_be_written_is_an_error() {
    let full = || std::fs::File::create("/dev/full").unwrap();
    for command in [&["presets"][..], &["presets", "esc26"], &["features"], &["completions", "man"]]
    {
        let run = ended(tool().args(command).stdout(full())).with(2);
        assert!(run.stderr.starts_with("error: standard output: "), "{}", run.stderr);
    }
}

#[cfg(unix)]
#[test]
fn a_run_goes_on_when_nobody_reads_its_messages() {
    let folder = folder(3);
    let audio = folder.path().join("audio");
    std::fs::write(audio.join("bad.wav"), b"RIFF").unwrap();
    let out = folder.path().join("feats.npz");
    let mut child = extraction(&audio, &out, &[]).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert_eq!(table(&out).outcomes().len(), 4);
}

fn piped(from: &Path, out: &Path, more: &[&str]) -> Ended {
    let mut run = extraction(Path::new("-"), out, more);
    let mut child = run.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // A run that is refused does not read.
    let _ = child.stdin.take().unwrap().write_all(&std::fs::read(from).unwrap());
    let output = child.wait_with_output().unwrap();
    Ended {
        code: output.status.code(),
        stdout: String::new(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

#[test]
fn a_stream_is_never_taken_for_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let one = wav(&folder.path().join("1.wav"), 1, 4000, 1);
    let two = wav(&folder.path().join("2.wav"), 1, 4000, 2);
    let out = folder.path().join("feats.npz");
    piped(&one, &out, &[]).with(0);
    let first = std::fs::read(&out).unwrap();
    let run = piped(&two, &out, &[]).with(2);
    assert!(run.stderr.contains("stream") && run.stderr.contains("--overwrite"), "{}", run.stderr);
    assert!(std::fs::read(&out).unwrap() == first);
    piped(&two, &out, &["--overwrite"]).with(0);
    assert!(std::fs::read(&out).unwrap() != first);
}

/// A look at the header before the run took the beginning of what came.
#[cfg(unix)]
#[test]
fn a_named_pipe_is_read_once_and_from_its_beginning() {
    let folder = tempfile::tempdir().unwrap();
    let one = wav(&folder.path().join("1.wav"), 2, 4000, 1);
    let (pipe, out) = (folder.path().join("pipe"), folder.path().join("feats.npz"));
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let bytes = std::fs::read(&one).unwrap();
    // The second one's table is as wide as the recordings have channels.
    for more in [&["--overwrite"][..], &["--overwrite", "--preset", "mfcc-zcr"]] {
        let writer = std::thread::spawn({
            let (pipe, bytes) = (pipe.clone(), bytes.clone());
            move || std::fs::write(pipe, bytes)
        });
        extract(&pipe, &out, more).with(0);
        writer.join().unwrap().unwrap();
        let found = table(&out);
        let outcome = &found.outcomes()[0];
        assert_eq!((outcome.status, outcome.decoded_frames), (Status::Ok, 4000));
        if more.len() > 1 {
            let file = folder.path().join("file.npz");
            extract(&one, &file, more).with(0);
            assert_eq!(found.values(), table(&file).values());
        }
    }
    // Nobody writes to it: what needs the bytes twice is refused, and a run that waits can be ended.
    let refused = extract(&pipe, &out, &["--window", "0.1", "--overwrite"]).with(2);
    assert!(
        refused.stderr.contains("is a pipe or device, so it cannot be cut"),
        "{}",
        refused.stderr
    );
    for paths in [&[&pipe][..], &[&pipe, &one]] {
        let refused = ended(tool().arg("inspect").args(paths)).with(2);
        assert!(refused.stderr.contains("name a file"), "{}", refused.stderr);
    }
    let manifest = folder.path().join("list.csv");
    std::fs::write(&manifest, "path\npipe\n").unwrap();
    let refused = extract(&manifest, &out, &["--overwrite"]).with(2);
    assert!(refused.stderr.contains("not in a manifest"), "{}", refused.stderr);
    let waits = folder.path().join("waits.npz");
    let mut child = extraction(&pipe, &waits, &[]).spawn().unwrap();
    while !folder.path().join("waits.npz.ledger").exists() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert_eq!(crate::command::interrupt(&mut child), Some(130));
}

/// A run that was resumed kept the features of the stream before.
#[test]
fn a_resumed_run_reads_its_stream_again() {
    let folder = tempfile::tempdir().unwrap();
    let one = wav(&folder.path().join("1.wav"), 1, 4000, 1);
    let two = wav(&folder.path().join("2.wav"), 1, 8000, 2);
    let bad = folder.path().join("bad.wav");
    std::fs::write(&bad, "RIFF").unwrap();
    let out = folder.path().join("feats.npz");
    piped(&one, &out, &["--in", text(&bad), "--max-errors", "0"]).with(2);
    let run = piped(&two, &out, &["--in", text(&bad), "--resume"]).with(1);
    assert!(run.stderr.contains("came from a stream"), "{}", run.stderr);
    assert_eq!(table(&out).outcomes()[0].decoded_frames, 8000);
}
