//! `nets`, and `train`, `cross-validate` and `classify` with a network.

use std::path::Path;

use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzWriter};
use serde_json::Value;

use crate::command::{done, refused, text};

/// Sequences of 128 numbers, each higher where the container is full, of three containers.
fn sequences(path: &Path) {
    let mut npz = NpzWriter::create(path, Compression::Stored).unwrap();
    let (mut x, mut offsets, mut names, mut containers) = (Vec::new(), vec![0i64], vec![], vec![]);
    for item in 0..12usize {
        let (steps, level) = (1 + item % 3, item % 2);
        let value = |k: usize| ((k * 7919 + item * 31) % 100) as f32 / 100.0 + level as f32;
        x.extend((0..steps * 128).map(value));
        offsets.push(x.len() as i64 / 128);
        names.push(format!("s{}_fi{level}_fu{level}_b0_l0", item % 3));
        containers.push(1 + item as i64 / 4);
    }
    let ints = |npz: &mut NpzWriter, name: &str, values: &[i64]| {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let header = Header::new(DType::parse("<i8").unwrap(), &[values.len()]);
        npz.array(name, &header, &bytes).unwrap();
    };
    npz.floats("X", &[x.len() / 128, 128], &x).unwrap();
    ints(&mut npz, "offsets", &offsets);
    ints(&mut npz, "container", &containers);
    let ids: Vec<String> = (0..12).map(|i| format!("r{i:02}")).collect();
    npz.strings("ids", &ids).unwrap();
    npz.strings("sequence", &names).unwrap();
    npz.finish().unwrap();
}

#[test]
fn networks_are_listed_and_explained() {
    let list = done(&["nets"]);
    for name in ["m1", "m2_type", "m4_level", "m5_r21d_type", "m6_shaking", "vggish", "m4", "m5"] {
        let named = |line: &str| line.trim_start().starts_with(&format!("{name} "));
        assert!(list.lines().any(named), "{name}\n{list}");
    }
    let system = done(&["nets", "m4"]);
    assert!(system.contains("m4_type, m4_level") && system.contains("capacity"), "{system}");
    let one = done(&["nets", "m2-type"]);
    for expected in ["86876 parameters", "convolution 120 x 40, 1 to 16, stride 4", "lr = 0.00025"]
    {
        assert!(one.contains(expected), "{expected}\n{one}");
    }
    let json: Value = serde_json::from_str(&done(&["nets", "m4-type", "--json"])).unwrap();
    assert_eq!(json["parameters"], 4_472_580);
    assert_eq!(json["recipe"]["weight_decay"], 1e-5);
    assert!(refused(&["nets", "m8"]).contains("m6_pouring"));
}

#[test]
fn a_network_is_validated_trained_and_applied() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (features, model) = (path("x.npz"), path("level.safetensors"));
    sequences(&features);
    let learn = [text(&features), "--net", "m5-vggish-level", "--target", "level"];
    let recipe = ["--set", "epochs=3", "--set", "batch=4", "--set", "lr=0.001"];
    let predictions = path("held-out.csv");
    let validate = ["--groups", "container", "--json", "-q", "-o", text(&predictions)];
    let report = done(&[&["cross-validate"], &learn[..], &recipe[..], &validate[..]].concat());
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["result"]["folds"].as_array().unwrap().len(), 3);
    assert_eq!(report["training"]["recipe"]["epochs"], 3);
    let lines = std::fs::read_to_string(&predictions).unwrap();
    assert_eq!(lines.lines().count(), 13, "{lines}");
    assert!(lines.starts_with("id,fold,group,true,predicted,p_0,p_1"), "{lines}");

    let kept = path("checkpoints");
    let train = [&["train"], &learn[..], &recipe[..], &["-q", "-o", text(&model)]].concat();
    done(&[&train[..], &["--checkpoints", text(&kept)]].concat());
    let first = std::fs::read(&model).unwrap();
    // From the checkpoint of a training that is over, and from nothing: the same bytes.
    for again in [vec!["--checkpoints", text(&kept)], vec!["--jobs", "1"]] {
        done(&[&train[..], &["--overwrite"], &again[..]].concat());
        assert!(std::fs::read(&model).unwrap() == first, "{again:?}");
    }

    let classify = ["classify", "-m", text(&model), "--features", text(&features), "-q"];
    let table = done(&classify);
    assert_eq!(table.lines().count(), 13, "{table}");
    assert!(table.lines().nth(1).is_some_and(|line| line.starts_with("r00,")), "{table}");
    assert!(refused(&["classify", "-m", text(&model), "x.wav"]).contains("give --features"));
}

#[test]
fn what_a_network_cannot_learn_from_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let features = folder.path().join("x.npz");
    let model = folder.path().join("out.safetensors");
    sequences(&features);
    let refuse = |more: &[&str], expected: &str| {
        let message = refused(&[&["train", text(&features), "-o", text(&model)], more].concat());
        assert!(message.contains(expected), "{message}");
        assert!(!model.exists());
    };
    refuse(&["--net", "m5-vggish-level", "--target", "weight"], "weight");
    refuse(&["--net", "m5-r21d-type", "--target", "type"], "X has 128 numbers a row");
    refuse(&["--net", "m2-capacity", "--target", "type"], "no classes");
    let level = ["--net", "m5-vggish-level", "--target", "level"];
    refuse(&[&level[..], &["--set", "epoch=3"]].concat(), "epochs");
    refuse(&[&level[..], &["--set", "lr=-1"]].concat(), "above 0");
    refuse(&[&level[..], &["--set", "select=validation"]].concat(), "groups");
}

#[test]
fn systems_of_the_paper_join_the_benchmark() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("ccm"), folder.path().join("report"));
    done(&["synth", "--out", text(&data), "--small", "--quiet"]);
    let folders = ["benchmark", "--data", text(&data), "--out", text(&out)];
    let scores = done(&[&folders[..], &["--methods", "m1,m2,m5", "--epochs", "1"]].concat());
    // Baselines run only where they are asked for.
    assert!(!scores.contains("kNN"), "{scores}");
    for (name, tasks) in [("M1", 2), ("M2", 1), ("M5", 2)] {
        let line = scores.lines().find(|line| line.starts_with(name)).unwrap();
        assert_eq!(line.matches(" to ").count(), tasks, "{line}");
    }
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let submission = read("submissions/m1-held-out.csv");
    assert_eq!(submission.lines().count(), 58, "{submission}");
    for name in ["figures/m1-joint-confusion.svg", "figures/m2-type-confusion.svg"] {
        assert!(out.join(name).exists(), "{name}");
    }
    assert!(!out.join("figures/m2-level-confusion.svg").exists());
    let report: Value = serde_json::from_str(&read("report.json")).unwrap();
    let report = report.to_string();
    for note in [
        "m2_type was trained for 1 epoch, its recipe has 500.",
        "type only; its capacity needs the depth views.",
        "vggish embeddings were not given",
    ] {
        assert!(report.contains(note), "{note}");
    }
    // The paper's figures stand beside.
    let table = read("tables/type.csv");
    let rows = table.lines().filter(|line| line.starts_with("M2,")).count();
    assert_eq!(rows, 2, "{table}");

    let refuse = |more: &[&str], expected: &str| {
        let message = refused(&[&folders[..], more].concat());
        assert!(message.contains(expected), "{message}");
    };
    refuse(&["--methods", "m3"], "four views");
    refuse(&["--methods", "m9"], "m1, m2, m3, m4, m5, m6");
    refuse(&["--methods", "m1,M1"], "given twice");
    let nowhere = "yamnet=nowhere.npz";
    refuse(&["--methods", "m5", "--embeddings", nowhere], "vggish and r21d");
}
