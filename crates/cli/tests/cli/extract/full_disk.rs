//! A disk that is full: said with its path, and nothing lost.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::Command;

use super::support::{Ended, ended, extract, folder, wav};
use crate::command::text;

/// Runs `script` where `DIR` is a file system of its own of 1 MiB, seen by nobody else. `None`, with
/// a message, where the system allows no such thing.
fn on_a_small_disk(folder: &Path, script: &str) -> Option<Ended> {
    let disk = folder.join("disk");
    std::fs::create_dir_all(&disk).unwrap();
    let mount = "mount -t tmpfs -o size=1m none \"$DIR\"";
    let sandbox = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script]);
        command.env("DIR", &disk).env("FEAT", env!("CARGO_BIN_EXE_corsmal-feat"));
        command
    };
    if !sandbox(mount).output().is_ok_and(|output| output.status.success()) {
        println!("skipped: no file system can be mounted here (unshare, tmpfs)");
        return None;
    }
    Some(ended(&mut sandbox(&format!("{mount} && {script}"))))
}

#[test]
fn a_run_on_a_full_disk_goes_on_once_there_is_room() {
    let folder = folder(120);
    let audio = folder.path().join("audio");
    for (name, more) in [("frames.npz", ""), ("packed.npz", "--compress")] {
        let whole = folder.path().join(name);
        let options: Vec<&str> = more.split_whitespace().collect();
        extract(&audio, &whole, &options).with(0);
        let run = format!("\"$FEAT\" extract --in {} --out \"$DIR/{name}\" {more}", text(&audio));
        let script = format!(
            "{{ {run}; code=$?; ls \"$DIR\" >&2; mount -o remount,size=64m \"$DIR\" && \
             {run} --resume && cmp \"$DIR/{name}\" {} && exit $code; }}",
            text(&whole)
        );
        let Some(run) = on_a_small_disk(folder.path(), &script) else { return };
        let Ended { stderr, .. } = run.with(2);
        assert!(stderr.contains("error: ") && stderr.contains("No space left"), "{stderr}");
        assert!(stderr.contains(name), "{stderr}");
        assert!(stderr.lines().any(|line| line == format!("{name}.ledger")), "{stderr}");
        assert!(!stderr.lines().any(|line| line == name), "half an output: {stderr}");
    }
}

/// Values of long recordings go to a temporary file beside the output.
#[test]
fn a_full_disk_under_temporary_files_is_no_fault_of_the_recording() {
    let folder = folder(0);
    let long = wav(&folder.path().join("long.wav"), 1, 2_000_000, 1);
    let run = format!("\"$FEAT\" extract --in {} --add stft --out \"$DIR/x.npz\"", text(&long));
    let Some(run) = on_a_small_disk(folder.path(), &run) else { return };
    let Ended { stdout, stderr, .. } = run.with(2);
    assert!(stderr.contains("No space left") && stderr.contains("disk"), "{stdout}{stderr}");
}

/// Other files that are written: nothing half stays under their names.
#[test]
fn tables_and_models_appear_whole_or_not_at_all() {
    let folder = folder(6);
    let (audio, table) = (folder.path().join("audio"), folder.path().join("t.npz"));
    extract(&audio, &table, &["--preset", "mfcc-zcr"]).with(0);
    let table = text(&table);
    for (name, command) in [
        ("pca.npz", format!("pca {table} --n-components 3 --out")),
        (
            "x.model",
            format!("train {table} --labels folders --target class --set trees=2000 --out"),
        ),
        ("merged.npz", format!("merge {table} --out")),
    ] {
        let script = format!(
            "dd if=/dev/zero of=\"$DIR/full\" bs=4096 count=256 2>/dev/null; \
             \"$FEAT\" {command} \"$DIR/{name}\"; code=$?; ls \"$DIR\" >&2; exit $code"
        );
        let Some(run) = on_a_small_disk(folder.path(), &script) else { return };
        let Ended { stderr, .. } = run.with(2);
        assert!(stderr.contains("No space left"), "{name}: {stderr}");
        assert!(!stderr.lines().any(|line| line == name), "{name}: {stderr}");
    }
}
