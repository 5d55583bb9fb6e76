//! Helpers of the black-box tests.

use std::path::PathBuf;
use std::process::Command;

/// Runs a Python script with arguments; `None`, with a line that says so, where there is no Python
/// with the modules. `CORSMAL_PYTHON` names another interpreter than `python3`.
pub fn python(modules: &[&str], script: &str, arguments: &[&str]) -> Option<String> {
    let program = std::env::var("CORSMAL_PYTHON").unwrap_or_else(|_| "python3".into());
    let imports = format!("import {}", modules.join(", "));
    let probe = Command::new(&program).args(["-c", &imports]).output();
    if !probe.is_ok_and(|output| output.status.success()) {
        println!("skipped: {program} with {} absent", modules.join(", "));
        return None;
    }
    let script = format!("{imports}\n{script}");
    let output = Command::new(&program).args(["-c", &script]).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

/// The path as an argument.
pub fn text(path: &std::path::Path) -> &str {
    path.to_str().unwrap()
}

/// A folder of empty files.
pub fn folder(files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::TempDir::new().unwrap();
    for file in files {
        let path: PathBuf = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, b"").unwrap();
    }
    folder
}
