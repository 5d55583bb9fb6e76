//! A build without the feature `nets` says how to get it, and has everything else.
//! A program of its own, so that the other tests are not compiled again for it.
#![cfg(not(feature = "nets"))]
#![allow(clippy::unwrap_used)]

use std::process::Command;

#[test]
fn what_needs_networks_names_the_build_that_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).into_os_string().into_string().unwrap();
    let (features, model) = (&path("x.npz"), &path("level.safetensors"));
    // As a trained network begins.
    std::fs::write(model, b"\x02\0\0\0\0\0\0\0{}").unwrap();
    let out = &path("out.safetensors");
    let commands: [&[&str]; 8] = [
        &["nets"],
        &["train", features, "--net", "m2-type", "-o", out],
        &["cross-validate", features, "--net", "m2-type"],
        &["embed", "vggish", "a.wav", "--weights", "w.pth", "-o", "out.npz"],
        &["benchmark", "--data", "ccm", "--out", "report", "--methods", "m1"],
        &["classify", "-m", model, "x.wav"],
        &["capacity", "train", "--method", "m2", "--data", "ccm", "-o", out],
        &["capacity", "--method", "m2", "--model", model, "--data", "ccm", "-o", "o.csv"],
    ];
    for command in commands {
        let run = Command::new(env!("CARGO_BIN_EXE_corsmal-feat")).args(command).output().unwrap();
        assert_eq!((run.status.code(), run.stdout.as_slice()), (Some(2), &b""[..]), "{command:?}");
        let message = String::from_utf8(run.stderr).unwrap();
        let way = "cargo install --path crates/cli --features nets";
        assert!(message.contains(way), "{command:?}: {message}");
    }
}
