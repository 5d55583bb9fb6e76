//! Running the command.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The command, without anything of the tests' own environment.
pub fn tool() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_corsmal-feat"));
    command.env_remove("CORSMAL_FEAT_JOBS").stdin(Stdio::null());
    command
}

pub fn run(arguments: &[&str]) -> Output {
    tool().args(arguments).output().unwrap()
}

/// What a command prints that must succeed.
#[track_caller]
pub fn done(arguments: &[&str]) -> String {
    let output = run(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// The messages of a command that must not run: warnings, then one error.
#[track_caller]
pub fn refused(arguments: &[&str]) -> String {
    let output = run(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty());
    let mut rest = message.lines().skip_while(|line| line.starts_with("warning: "));
    assert!(rest.next().is_some_and(|line| line.starts_with("error: ")), "{message}");
    assert!(!rest.any(|line| line.starts_with("error: ")), "{message}");
    message
}

/// A file with some text.
pub fn written(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Sends SIGINT and gives the exit code; `None` where a minute later the process still runs, which
/// then is ended.
#[cfg(unix)]
pub fn interrupt(process: &mut std::process::Child) -> Option<i32> {
    let sent = Command::new("kill").args(["-INT", &process.id().to_string()]).status().unwrap();
    assert!(sent.success());
    for _ in 0..600 {
        if let Some(status) = process.try_wait().unwrap() {
            return status.code();
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    process.kill().unwrap();
    None
}

/// Largest memory of a running process so far, in KiB; `None` once it has ended.
#[cfg(target_os = "linux")]
pub fn peak_memory(process: &std::process::Child) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Names of the files of a folder.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Says that a test does not run, past the test harness, which keeps what passing tests print.
pub fn skipped(why: &str) {
    std::io::stderr().write_all(format!("skipped: {why}\n").as_bytes()).unwrap();
}

/// A file of the reference data; `None`, with a message, where they are absent.
pub fn shared(name: &str) -> Option<PathBuf> {
    let root = std::env::var("CORSMAL_SHARED")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared").to_string());
    let path = Path::new(&root).join(name);
    if !path.exists() {
        skipped(&format!("{} absent", path.display()));
        return None;
    }
    Some(path)
}
