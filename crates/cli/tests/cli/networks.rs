//! `nets`, and `train`, `cross-validate` and `classify` with a network.

use std::path::Path;

use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzWriter};
use serde_json::Value;

use crate::command::{done, interrupt, refused, run, text, tool};
use crate::hearing::tone;

/// As [`some_sequences`], all of them with names.
fn sequences(path: &Path) {
    some_sequences(path, 0);
}

/// Sequences of 128 numbers, each higher where the container is full, of three containers. The last `nameless`
/// ones have no name, as those of test parts.
fn some_sequences(path: &Path, nameless: usize) {
    let mut npz = NpzWriter::create(path, Compression::Stored).unwrap();
    let (mut x, mut offsets, mut names, mut containers) = (Vec::new(), vec![0i64], vec![], vec![]);
    for item in 0..12usize {
        let (steps, level) = (1 + item % 3, item % 2);
        let value = |k: usize| ((k * 7919 + item * 31) % 100) as f32 / 100.0 + level as f32;
        x.extend((0..steps * 128).map(value));
        offsets.push(x.len() as i64 / 128);
        let name = format!("s{}_fi{level}_fu{level}_b0_l0", item % 3);
        names.push(if item + nameless < 12 { name } else { String::new() });
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
    assert_eq!((&json["preset"], &json["paper"]), (&"m4-code".into(), &serde_json::json!({})));
    let level = done(&["nets", "m4-level"]);
    assert!(level.contains("takes m4_type's features of each window"), "{level}");
    assert!(level.contains("recipe=paper") && level.contains("lr = 0.00001"), "{level}");
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
    // Its content says that a file holds inputs, not its name.
    let renamed = path("inputs.dat");
    std::fs::copy(&features, &renamed).unwrap();
    let words = [&["train", text(&renamed)], &train[2..], &["--overwrite"]].concat();
    done(&words);
    let parameters = |bytes: &[u8]| {
        let header = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        bytes[8 + header..].to_vec()
    };
    assert!(parameters(&std::fs::read(&model).unwrap()) == parameters(&first));
    // From the checkpoint of a training run that is over, and from nothing: the same bytes.
    for again in [vec!["--checkpoints", text(&kept)], vec!["--jobs", "1"]] {
        done(&[&train[..], &["--overwrite"], &again[..]].concat());
        assert!(std::fs::read(&model).unwrap() == first, "{again:?}");
    }

    let classify = ["classify", "-m", text(&model), "--features", text(&features), "-q"];
    let table = done(&classify);
    assert_eq!(table.lines().count(), 13, "{table}");
    assert!(table.lines().nth(1).is_some_and(|line| line.starts_with("r00,")), "{table}");
    let table = path("table.npz");
    std::fs::write(&table, b"PAR1").unwrap();
    let message = refused(&["classify", "-m", text(&model), "--features", text(&table)]);
    assert!(message.contains("is a Parquet table"), "{message}");
    let message = refused(&["classify", "-m", text(&model), "x.wav"]);
    assert!(message.contains("takes VGGish embeddings, not recordings"), "{message}");
}

#[test]
fn items_without_a_label_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let (features, model) = (folder.path().join("x.npz"), folder.path().join("level.safetensors"));
    some_sequences(&features, 3);
    let words = ["train", text(&features), "--net", "m5-vggish-level", "-o", text(&model)];
    let words = [&words[..], &["--target", "level", "--set", "epochs=1", "--json"]].concat();
    let output = run(&words);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("3 items without level: left out"), "{said}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["items"], 9);
    some_sequences(&features, 12);
    let message = refused(&[&words[..], &["--overwrite"]].concat());
    assert!(message.contains("level"), "{message}");
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
    refuse(&["--net", "m5-r21d-type", "--target", "type"], "X has 128 numbers per row");
    refuse(&["--net", "m2-capacity", "--target", "type"], "numbers, not classes");
    let level = ["--net", "m5-vggish-level", "--target", "level"];
    refuse(&[&level[..], &["--set", "epoch=3"]].concat(), "epochs");
    refuse(&[&level[..], &["--set", "lr=-1"]].concat(), "above 0");
    refuse(&[&level[..], &["--set", "recipe=book"]].concat(), "code or paper");
    refuse(&[&level[..], &["--device", "cuda"]].concat(), "[possible values: cpu, gpu]");
    if !cfg!(feature = "gpu") {
        let refusal = "device gpu: this build has no GPU support: build it with --features gpu";
        refuse(&[&level[..], &["--device", "gpu"]].concat(), refusal);
    }
    refuse(&[&level[..], &["--x", "OTHER"]].concat(), "no member OTHER");
    refuse(&[&level[..], &["--ids", "names"]].concat(), "no member names");
    refuse(&[&level[..], &["--seed", "1", "--set", "seed=1"]].concat(), "give one");
    let wild = ["--set", "epochs=1", "--set", "lr=1e39", "-q"];
    refuse(&[&level[..], &wild].concat(), "training step 1");
    let table = folder.path().join("table.npz");
    std::fs::write(&table, b"PAR1").unwrap();
    let words = ["train", text(&table), "-o", text(&model)];
    let message = refused(&[&words[..], &level[..]].concat());
    assert!(message.contains("is a Parquet table; a network takes an .npz"), "{message}");
    let recordings = folder.path().join("audio");
    tone(&recordings.join("a/1.wav"), 0, 0.1, 16_000);
    let words = ["train", text(&recordings), "--net", "m4-type", "--labels", "folders", "--x", "Y"];
    assert!(
        refused(&[&words[..], &["-o", text(&model)]].concat()).contains("recordings have none")
    );
    let words = ["cross-validate", text(&features), "--seeds", "3"];
    assert!(refused(&[&words[..], &level[..]].concat()).contains("--seeds"));
}

#[test]
fn embedding_needs_the_weights_of_its_network() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (audio, weights, out) = (path("a.wav"), path("w.npz"), path("out.npz"));
    tone(&audio, 0, 1.0, 16_000);
    let mut npz = NpzWriter::create(&weights, Compression::Stored).unwrap();
    npz.floats("features.0.weight", &[2, 2], &[0.0; 4]).unwrap();
    npz.finish().unwrap();
    let refuse = |network: &str, weights: &Path, expected: &str| {
        let words = ["embed", network, text(&audio), "--weights", text(weights), "-o", text(&out)];
        let message = refused(&words);
        assert!(message.contains(expected), "{message}");
        assert!(!out.exists());
    };
    refuse("vggish", &weights, "features.3.weight");
    refuse("vggish", &path("none.pth"), "none.pth");
    refuse("m2-type", &weights, "gives classes");
    refuse("yamnet", &weights, "vggish");
}

#[test]
fn the_seed_is_that_of_the_training() {
    let folder = tempfile::tempdir().unwrap();
    let features = folder.path().join("x.npz");
    sequences(&features);
    let train = |seed: &[&str]| {
        let out = folder.path().join(format!("{}.safetensors", seed.join("")));
        let words = ["train", text(&features), "--net", "m5-vggish-level", "--target", "level"];
        let more = ["--set", "epochs=1", "-q", "-o", text(&out)];
        done(&[&words[..], &more[..], seed].concat());
        std::fs::read(out).unwrap()
    };
    assert!(train(&["--seed", "7"]) == train(&["--set", "seed=7"]));
}

#[test]
fn a_score_that_chose_its_epoch_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let features = folder.path().join("x.npz");
    sequences(&features);
    let words =
        ["cross-validate", text(&features), "--net", "m5-vggish-level", "--target", "level"];
    let more = ["--cv", "2", "--set", "epochs=1", "--set", "select=published"];
    let words = [&words[..], &more[..]].concat();
    let said = "the held-out fold also chose the epoch";
    assert!(done(&words).contains(said));
    let output = run(&[&words[..], &["--json"]].concat());
    assert!(String::from_utf8_lossy(&output.stderr).contains(said));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["caution"].as_str().is_some_and(|text| text.contains(said)), "{report}");
}

#[cfg(unix)]
#[test]
fn a_training_can_be_interrupted() {
    use std::io::{BufRead, BufReader};

    let folder = tempfile::tempdir().unwrap();
    let (features, model) = (folder.path().join("x.npz"), folder.path().join("x.safetensors"));
    sequences(&features);
    let words = ["train", text(&features), "--net", "m5-vggish-level", "--target", "level"];
    let more = ["--set", "epochs=100000", "-o", text(&model)];
    let mut command = tool();
    command.args(words).args(more).stderr(std::process::Stdio::piped());
    let mut process = command.spawn().unwrap();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("epoch 1 of 100000")));
    assert_eq!(interrupt(&mut process), Some(130));
    assert!(lines.any(|line| line.contains("stopped after")));
    assert!(!model.exists());
}

#[test]
fn the_group_that_chose_the_epoch_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (features, model) = (folder.path().join("x.npz"), folder.path().join("level.safetensors"));
    sequences(&features);
    let learn = ["train", text(&features), "--net", "m5-vggish-level", "--target", "level"];
    let by = ["--groups", "container", "--set", "select=validation", "--set", "epochs=2"];
    let said = done(&[&learn[..], &by, &["-o", text(&model)]].concat());
    let (_, group) = said.split_once("the best on container ").unwrap();
    let group = group.split(',').next().unwrap();
    // Without --groups, it is the column that is called so.
    let usual = folder.path().join("usual.safetensors");
    let told = done(&[&learn[..], &by[2..], &["-o", text(&usual)]].concat());
    assert!(told.contains(&format!("the best on container {group},")), "{told}");
    assert!(std::fs::read(&usual).unwrap() == std::fs::read(&model).unwrap());
    assert!(said.contains("which was not trained on"), "{said}");
    let shown: Value = serde_json::from_str(&done(&["inspect", text(&model), "--json"])).unwrap();
    assert!(shown.to_string().contains(&format!("\"validation_group\":\"{group}\"")), "{shown}");

    // Rows without one were a group of their own.
    let labels = folder.path().join("labels.csv");
    let row =
        |i: usize| format!("r{i:02},{},{}\n", i % 2, if i < 3 { "" } else { ["a", "b"][i % 2] });
    let rows: String = (0..12).map(row).collect();
    std::fs::write(&labels, format!("id,full,container\n{rows}")).unwrap();
    let learn = ["train", text(&features), "--net", "m5-vggish-level", "--labels", text(&labels)];
    let learn = [&learn[..], &["--target", "full", "-o", text(&usual), "--overwrite"]].concat();
    let message = refused(&[&learn[..], &by[2..]].concat());
    assert!(message.contains("groups: 3 rows without container of 12"), "{message}");
    done(&[&learn[..], &["--set", "epochs=1"]].concat());

    // A damaged network gives a training nothing to begin with.
    let mut bytes = std::fs::read(&model).unwrap();
    let last = bytes.len() - 9;
    bytes[last] ^= 1;
    std::fs::write(&model, bytes).unwrap();
    let message = refused(&[&learn[..], &["--weights", text(&model)]].concat());
    assert!(message.contains("damaged"), "{message}");
}
