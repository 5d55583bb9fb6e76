//! A build without the feature `nets` says how to get it, and has everything else.

use crate::command::{refused, text};

#[test]
fn what_needs_networks_names_the_build_that_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (features, model) = (path("x.npz"), path("level.safetensors"));
    // As a trained network begins.
    std::fs::write(&model, b"\x02\0\0\0\0\0\0\0{}").unwrap();
    let out = path("out.safetensors");
    let commands: [&[&str]; 8] = [
        &["nets"],
        &["train", text(&features), "--net", "m2-type", "-o", text(&out)],
        &["cross-validate", text(&features), "--net", "m2-type"],
        &["embed", "vggish", "a.wav", "--weights", "w.pth", "-o", "out.npz"],
        &["benchmark", "--data", "ccm", "--out", "report", "--methods", "m1"],
        &["classify", "-m", text(&model), "x.wav"],
        &["capacity", "train", "--method", "m2", "--data", "ccm", "-o", text(&out)],
        &["capacity", "--method", "m2", "--model", text(&model), "--data", "ccm", "-o", "o.csv"],
    ];
    for command in commands {
        let message = refused(command);
        let way = "cargo install --path crates/cli --features nets";
        assert!(message.contains(way), "{command:?}: {message}");
    }
}
