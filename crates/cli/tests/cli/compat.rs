//! Files of earlier versions, kept in `tests/compat`: they open, or are refused in words.

use std::path::{Path, PathBuf};

use crate::command::{done, refused, text};

fn kept(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/compat/0.1.0").join(name)
}

#[test]
fn feature_files_of_0_1_0_open() {
    for name in ["frames.npz", "table.npz", "deflated.npz", "table.parquet", "pca.npz"] {
        let shown = done(&["inspect", text(&kept(name))]);
        assert!(
            shown.contains(if name == "pca.npz" { "42 features to 2" } else { "4 ok" }),
            "{shown}"
        );
    }
    for other in ["deflated.npz", "table.parquet"] {
        done(&["compare", text(&kept("table.npz")), text(&kept(other))]);
    }
}

#[test]
fn models_of_0_1_0_predict_what_they_did() {
    let expected = std::fs::read_to_string(kept("predictions.csv")).unwrap();
    for table in ["table.npz", "table.parquet"] {
        let (model, table) = (kept("pitch.model"), kept(table));
        let classify = ["classify", "--model", text(&model), "--features", text(&table)];
        assert!(refused(&classify).contains("--any-rate"));
        let classify = [&classify[..], &["--any-rate"]].concat();
        // Labels go along since then.
        let found = done(&[&classify[..], &["--out", "-"]].concat());
        let without_labels: String = found
            .lines()
            .map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                [&cells[..3], &cells[4..]].concat().join(",") + "\n"
            })
            .collect();
        assert!(found.starts_with("id,path,status,true,predicted"), "{found}");
        assert_eq!(without_labels, expected);
    }
}

#[test]
fn an_interrupted_run_of_0_1_0_is_refused_and_stays() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["left.npz.ledger", "left.npz.part"] {
        std::fs::copy(kept(name), at(name)).unwrap();
    }
    std::fs::write(at("a.wav"), b"RIFF").unwrap();
    let (audio, out) = (at("a.wav"), at("left.npz"));
    let extract = ["extract", "--in", text(&audio), "--out", text(&out), "--resume"];
    let message = refused(&extract);
    assert!(message.contains("ledger version 1, this one has 2"), "{message}");
    for name in ["left.npz.ledger", "left.npz.part"] {
        assert_eq!(std::fs::read(kept(name)).unwrap(), std::fs::read(at(name)).unwrap(), "{name}");
    }
}
