//! `nets`, and `train`, `cross-validate` and `classify` with a network.

use std::path::Path;

use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzWriter};
use serde_json::Value;

use crate::command::{done, interrupt, refused, run, text, tool};

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
    refuse(&[&level[..], &["--set", "select=validation"]].concat(), "groups");
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

/// A second of eight channels: a tone, or noise.
fn tone(path: &Path, class: usize, seconds: f64, rate: u32) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let spec = hound::WavSpec {
        channels: 8,
        sample_rate: rate,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    let frames = (seconds * f64::from(rate)) as u32;
    for i in 0..8 * frames {
        let noise = f64::from(i.wrapping_mul(2_654_435_761) >> 16) - 32_768.0;
        let sine = 20_000.0 * (f64::from(i / 8) * 0.05).sin();
        writer.write_sample(if class == 0 { sine } else { noise * 0.5 } as i16).unwrap();
    }
    writer.finalize().unwrap();
}

#[test]
fn a_network_learns_from_recordings_and_hears_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let audio = path("audio");
    for (class, name) in ["tone", "noise"].iter().enumerate() {
        for take in 0..3 {
            tone(&audio.join(name).join(format!("{take}.wav")), class, 1.0, 44_100);
        }
    }
    // Too short for a window of 64 frames.
    tone(&audio.join("tone/short.wav"), 0, 0.3, 44_100);
    tone(&audio.join("noise/short.wav"), 1, 0.25, 44_100);
    // A header that was never completed.
    let unfinished = audio.join("noise/2.wav");
    let mut bytes = std::fs::read(&unfinished).unwrap();
    let data = bytes.windows(4).position(|word| word == b"data").unwrap();
    bytes[data + 4..data + 8].fill(0);
    std::fs::write(&unfinished, bytes).unwrap();
    let model = path("type.safetensors");
    let learn = ["train", text(&audio), "--net", "m4-type", "--labels", "folders"];
    // Windows of one recording would be on both sides.
    let split = ["--set", "select=split", "-o", "split.model"];
    let refusal = refused(&[&learn[..], &split[..]].concat());
    assert!(refusal.contains("recordings have several windows"), "{refusal}");
    let recipe = ["--set", "epochs=4", "--set", "batch=6", "--set", "lr=0.001", "-o", text(&model)];
    let output = run(&[&learn[..], &recipe[..]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    let told = |words: &str| message.lines().filter(|line| line.contains(words)).count();
    assert_eq!(told("short: too short: "), 1, "{message}");
    assert_eq!(told("1 more left out (too short): tone/short"), 1, "{message}");
    assert!(message.contains("warning: recordings: 1 repaired: 1 data_size_zero"), "{message}");

    // A line for each window of a recording, and the reason for the one that has none.
    let classify = ["classify", "-m", text(&model), text(&audio)];
    let output = run(&classify);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("warning: recordings: 1 repaired: 1 data_size_zero"), "{message}");
    let table = String::from_utf8(output.stdout).unwrap();
    let of = |id: &str| table.lines().filter(|l| l.starts_with(&format!("{id},"))).count();
    assert_eq!((of("tone/0"), of("noise/2"), of("tone/short")), (3, 3, 1), "{table}");
    let first = table.lines().find(|l| l.starts_with("tone/0,")).unwrap();
    assert!(first.contains(",0,0.64,") || first.contains(",0.0,0.64,"), "{first}");
    assert!(table.contains("too_short"), "{table}");

    // One decision for each, by their votes; right, since the network was trained on them.
    let votes = run(&[&classify[..], &["--vote", "majority"]].concat());
    let votes = String::from_utf8(votes.stdout).unwrap();
    assert_eq!(votes.lines().count(), 9, "{votes}");

    // A stream, window by window as it comes.
    let wav = audio.join("noise/1.wav");
    let live = ["classify", "-m", text(&model), "-", "--window", "0.7", "--hop", "0.1"];
    let stdin = std::fs::File::open(&wav).unwrap();
    let output = tool().args(live).stdin(stdin).output().unwrap();
    let live = String::from_utf8(output.stdout).unwrap();
    assert_eq!(live.lines().count(), 5, "{live}");

    // A vote is one over the windows that were asked for, not over those inside of them.
    let windows = path("windows.csv");
    let long = ["--window", "0.9", "--hop", "0.1", "-q"];
    run(&[&classify[..], &long, &["-o", text(&windows)]].concat());
    let outcome = |table: &str| -> Vec<Vec<String>> {
        let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let wanted = ["id", "predicted", "p_noise", "p_tone"];
        let place = |name: &str| head.iter().position(|column| *column == name);
        let at = wanted.map(|name| place(name).unwrap_or_else(|| panic!("{name}: {table}")));
        lines.map(|line| at.iter().map(|&at| line[at].to_string()).collect()).collect()
    };
    let voted = run(&[&classify[..], &long, &["--vote", "majority"]].concat());
    let voted = String::from_utf8(voted.stdout).unwrap();
    assert_eq!(voted.matches(",ok,2,").count(), 6, "two windows in a second: {voted}");
    let voted = outcome(&voted);
    let fused = run(&["fuse", text(&windows), "--vote", "majority", "-o", "-"]);
    let fused = outcome(&String::from_utf8(fused.stdout).unwrap());
    assert_eq!(fused, voted);

    // What is missing at the end of a file is said, for windows of either kind and for votes.
    let cut = path("cut.wav");
    let bytes = std::fs::read(&wav).unwrap();
    std::fs::write(&cut, &bytes[..bytes.len() - bytes.len() / 20]).unwrap();
    let classify = ["classify", "-m", text(&model), text(&cut)];
    let windows = ["--window", "0.7", "--hop", "0.1"];
    for more in [&windows[..], &[&windows[..], &["--vote", "majority"]].concat(), &[]] {
        let output = run(&[&classify[..], more].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        let table = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{more:?}: {message}");
        // Windows that end before what is missing are whole.
        let is_cut = table.contains(",truncated,");
        assert_eq!(is_cut, more != windows, "{more:?}: {table}");
        if !more.is_empty() {
            let warned = "warning: cut: truncated: the file ends after ";
            assert_eq!(message.matches(warned).count(), 1, "{more:?}: {message}");
        }
    }

    // Other formats are refused file by file.
    let other = path("other.wav");
    tone(&other, 0, 1.0, 22_050);
    let output = run(&["classify", "-m", text(&model), text(&other)]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("22,050 Hz; the model was trained on 44,100 Hz"), "{message}");
    let message = refused(&[
        "classify",
        "-m",
        text(&model),
        text(&other),
        "--set",
        "signal.sample_rate=8000",
    ]);
    assert!(message.contains("must be 44,100 Hz, as in training"), "{message}");

    let report = done(
        &[
            &["cross-validate"],
            &learn[1..],
            &["--cv", "3", "--set", "epochs=1", "--set", "batch=6", "-q", "--json"],
        ]
        .concat(),
    );
    let report: Value = serde_json::from_str(&report).unwrap();
    let rows: usize = report["result"]["folds"]
        .as_array()
        .unwrap()
        .iter()
        .map(|fold| fold["rows"].as_array().unwrap().len())
        .sum();
    assert_eq!(rows, 6);
    let level = ["train", text(&audio), "--net", "m4-level", "--labels", "folders"];
    let message = refused(&[&level[..], &["-o", text(&path("no.safetensors"))]].concat());
    assert!(message.contains("takes m4_type's features of each window"), "{message}");
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
