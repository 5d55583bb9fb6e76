//! Interrupted runs lose nothing.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use super::support::{extract, extraction, folder};
use crate::command::names;

/// Recordings that are done according to the ledger.
fn done(out: &Path) -> usize {
    let ledger = PathBuf::from(format!("{}.ledger", out.display()));
    let lines = std::fs::read(ledger).unwrap_or_default();
    lines.iter().filter(|b| **b == b'\n').count().saturating_sub(1)
}

/// Waits until a run has done so much; whether it still runs.
fn wait_for(child: &mut Child, out: &Path, count: usize) -> bool {
    loop {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        if done(out) >= count {
            return true;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
}

#[test]
fn killed_at_random_moments_and_resumed_gives_the_same_bytes() {
    const FILES: u32 = 120;
    let folder = folder(FILES);
    let audio = folder.path().join("audio");
    std::fs::write(audio.join("00/bad.wav"), b"RIFF").unwrap();
    let mut random = 1_u32;
    for (name, more) in [
        ("frames.npz", &[][..]),
        ("packed.npz", &["--compress"]),
        ("table.npz", &["--preset", "mfcc-zcr"]),
        ("table.parquet", &["--preset", "mfcc-zcr"]),
        ("frames.parquet", &[]),
    ] {
        let whole = folder.path().join(format!("whole-{name}"));
        extract(&audio, &whole, more).with(1);
        let out = folder.path().join(name);
        let resume = [more, &["--resume"]].concat();
        let (mut kills, mut last) = (0, 0);
        while kills < 10 {
            let mut child =
                extraction(&audio, &out, &resume).stderr(Stdio::null()).spawn().unwrap();
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let target = last + (random >> 16) as usize % (FILES as usize / 8);
            if !wait_for(&mut child, &out, target) {
                break;
            }
            std::thread::sleep(Duration::from_micros(u64::from(random >> 8) % 3000));
            child.kill().unwrap();
            child.wait().unwrap();
            // What was done stays done.
            if !out.exists() {
                assert!(done(&out) >= last);
                last = done(&out);
            }
            kills += 1;
        }
        assert!(kills > 0, "no run was killed");
        extract(&audio, &out, &resume).with(1);
        assert!(std::fs::read(&out).unwrap() == std::fs::read(&whole).unwrap(), "{name}");
    }
    assert!(names(folder.path()).iter().all(|n| !n.ends_with(".part")));
}

#[test]
fn an_interrupt_ends_with_130_and_can_be_resumed() {
    if !cfg!(unix) {
        println!("skipped: no signals");
        return;
    }
    let folder = folder(300);
    let audio = folder.path().join("audio");
    let (whole, out) = (folder.path().join("whole.npz"), folder.path().join("feats.npz"));
    extract(&audio, &whole, &[]).with(0);
    for (signal, count) in [("-INT", 2), ("-TERM", 100)] {
        let mut run = extraction(&audio, &out, &["--resume", "--jobs", "1"]);
        let mut child = run.stderr(Stdio::piped()).spawn().unwrap();
        assert!(wait_for(&mut child, &out, count), "the run was too fast to be interrupted");
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let output = child.wait_with_output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{message}");
        assert!(message.contains("--resume"), "{message}");
        assert!(!out.exists() && done(&out) >= count);
    }
    let run = extract(&audio, &out, &["--resume"]).with(0);
    assert!(run.stderr.contains("resumed"), "{}", run.stderr);
    assert!(std::fs::read(&out).unwrap() == std::fs::read(&whole).unwrap());
}

/// A pipe that stays open and says nothing cannot hold up the end.
#[cfg(unix)]
#[test]
fn an_interrupt_is_heard_while_the_stream_is_silent() {
    let folder = folder(1);
    let one = folder.path().join("audio/00/r0000.wav");
    // Silent before the header, and in the middle of the samples.
    for bytes in [0, 4000] {
        let out = folder.path().join(format!("{bytes}.npz"));
        let mut child =
            extraction(Path::new("-"), &out, &["--resume"]).stdin(Stdio::piped()).spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        stdin.write_all(&std::fs::read(&one).unwrap()[..bytes]).unwrap();
        let ledger = folder.path().join(format!("{bytes}.npz.ledger"));
        while !std::fs::metadata(&ledger).is_ok_and(|m| m.len() > 0) {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(crate::command::interrupt(&mut child), Some(130), "its input is still open");
        drop(stdin);
        assert_eq!(done(&out), 0, "the stream is no recording that failed");
    }
}

#[test]
fn two_runs_do_not_write_one_output() {
    let folder = folder(2);
    let out = folder.path().join("feats.npz");
    // Waits for samples until its input ends.
    let mut first = extraction(Path::new("-"), &out, &[]).stdin(Stdio::piped()).spawn().unwrap();
    let ledger = folder.path().join("feats.npz.ledger");
    while !std::fs::metadata(&ledger).is_ok_and(|m| m.len() > 0) {
        std::thread::sleep(Duration::from_millis(1));
    }
    for more in [&[][..], &["--resume"], &["--overwrite"]] {
        let second = extract(&folder.path().join("audio"), &out, more).with(2);
        assert!(second.stderr.contains("another run"), "{}", second.stderr);
    }
    drop(first.stdin.take());
    assert_eq!(first.wait().unwrap().code(), Some(1));
}
