//! Feature files that claim more than they hold: refused in words, within a limit of memory.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Stdio};

use crate::command::{shared, text};

/// What a command says that has to end by itself in 1 GiB of addresses.
#[track_caller]
fn limited(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new("sh")
        .args(["-c", "ulimit -v 1048576; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_corsmal-feat")])
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !message.contains("panicked") && message.len() < 5000,
        "{arguments:?}: {message:.2000}"
    );
    (output.status.code(), message)
}

#[track_caller]
fn refused(arguments: &[&str], expected: &str) {
    let (code, message) = limited(arguments);
    assert!(matches!(code, Some(1 | 2)), "{arguments:?}: {code:?}: {message}");
    assert!(message.contains(expected), "{arguments:?}: {message}");
}

/// Every command that reads a feature file.
#[track_caller]
fn refused_everywhere(path: &Path, expected: &str) {
    let file = text(path);
    let model = path.with_extension("model");
    let train = ["--features", file, "--target", "y", "--classifier", "knn", "--out"];
    let table = path.with_extension("out.npz");
    refused(&["inspect", file], expected);
    refused(&["compare", file, file], expected);
    refused(&[&["train"], &train[..], &[text(&model)]].concat(), expected);
    refused(&["pca", "--features", file, "--out", text(&table)], expected);
    refused(&["merge", file, "--out", text(&table)], expected);
}

#[test]
fn rows_without_data_are_refused() {
    let Some(path) = shared("cases/hostile/zero_shape.npz") else { return };
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("m");
    let train = ["train", "--features", text(&path), "--target", "y", "--classifier", "knn"];
    refused(&[&train[..], &["--out", text(&model)]].concat(), "is too large");
    refused(&["inspect", text(&path)], "is too large");
}

#[test]
fn members_that_share_bytes_are_refused() {
    let Some(packed) = shared("cases/hostile/overlap.npz.gz") else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("overlap.npz");
    let unpacked = Command::new("gzip").args(["-dc", text(&packed)]).output().unwrap();
    std::fs::write(&path, unpacked.stdout).unwrap();
    refused_everywhere(&path, "share bytes");
}

#[test]
fn parquet_files_that_claim_too_much_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, expected) in [
        ("parquet_map_skip_hang.parquet", "contradict"),
        ("parquet_caught1.parquet", "expected"),
        ("pq50m.parquet", ""),
    ] {
        let Some(path) = shared(&format!("cases/hostile/{name}")) else { return };
        let copy = folder.path().join(name);
        std::fs::copy(path, &copy).unwrap();
        refused_everywhere(&copy, expected);
    }
    let bomb = folder.path().join("pq50m.parquet");
    refused(&["compare", text(&bomb), text(&bomb)], "at most 8388608 values in 70738 bytes");
}
