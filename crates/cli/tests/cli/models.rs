//! `train`, `classify` and `cross-validate` as a user runs them.

use std::path::{Path, PathBuf};

use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzWriter};
use serde_json::Value;

use crate::command::{done, names, refused, run, text};

/// Synthetic recordings, their features and a label file.
struct Recordings {
    folder: tempfile::TempDir,
}

impl Recordings {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let this = Self { folder };
        done(&["synth", "--out", text(&this.path("data")), "--small", "--quiet"]);
        this.extract("esc26", "feats.npz");
        let mut labels = String::from("path,type,level,container\n");
        for container in 1..=9 {
            for name in names(&this.path(&format!("data/train/{container}/audio"))) {
                // s0_fi2_fu1_b0_l0_audio.wav: filling type 2, level 1
                let path = this.path(&format!("data/train/{container}/audio/{name}"));
                let (kind, level) = (&name[5..6], &name[9..10]);
                labels += &format!("{},{kind},{level},{container}\n", path.display());
            }
        }
        std::fs::write(this.path("labels.csv"), labels).unwrap();
        this
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn extract(&self, preset: &str, out: &str) {
        let (audio, out) = (self.path("data/train"), self.path(out));
        done(&["extract", "--in", text(&audio), "--out", text(&out), "--preset", preset, "-q"]);
    }
}

#[test]
fn from_recordings_to_predictions() {
    let r = Recordings::new();
    let (feats, labels) = (r.path("feats.npz"), r.path("labels.csv"));
    let (model, audio, out) = (r.path("type.model"), r.path("data/train"), r.path("out.csv"));
    let learn = ["--features", text(&feats), "--labels", text(&labels), "--target", "type"];
    let forest = ["--classifier", "rf", "--set", "trees=50", "--standardize"];
    let train = [&["train"], &learn[..], &forest[..], &["--out", text(&model)]].concat();
    assert!(done(&train).contains("57 rows, 26 features, type: 0 (9), 1 (18), 2 (18), 3 (12)"));
    assert!(refused(&train).contains("exists; --overwrite replaces it"));
    let first = std::fs::read(&model).unwrap();
    done(&[&train[..], &["--overwrite"]].concat());
    assert_eq!(std::fs::read(&model).unwrap(), first, "training again gives the same file");

    let classify = ["classify", "--model", text(&model)];
    let by_features = [&classify[..], &["--features", text(&feats), "--out", "-"]].concat();
    let expected = done(&by_features);
    assert_eq!(expected.lines().next(), Some("id,path,status,predicted,p_0,p_1,p_2,p_3"));
    assert_eq!(expected.lines().count(), 58);
    let by_recordings =
        [&classify[..], &["--in", text(&audio), "--out", text(&out), "-q"]].concat();
    done(&by_recordings);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), expected);
    let left = names(r.folder.path());
    assert_eq!(left, ["data", "feats.npz", "labels.csv", "out.csv", "type.model"]);

    std::fs::write(audio.join("1/audio/broken.wav"), "RIFF").unwrap();
    let output = run(&[&by_recordings[..], &["--overwrite"]].concat());
    assert_eq!(output.status.code(), Some(1));
    let predictions = std::fs::read_to_string(&out).unwrap();
    let (broken, others): (Vec<&str>, Vec<&str>) =
        predictions.lines().partition(|line| line.starts_with("1/audio/broken,"));
    assert_eq!(broken.len(), 1);
    assert!(broken[0].ends_with(",corrupt,,,,,"), "{}", broken[0]);
    assert_eq!(others, expected.lines().collect::<Vec<_>>());
    std::fs::remove_file(audio.join("1/audio/broken.wav")).unwrap();

    r.extract("esc28", "other.npz");
    let other = r.path("other.npz");
    let wrong = [&classify[..], &["--features", text(&other), "--out", "-"]].concat();
    assert!(refused(&wrong).contains("preset esc26 is expected, found preset esc28"));
    let table = [&classify[..], &["--in", text(&feats), "--out", "-"]].concat();
    assert!(refused(&table).contains("give it as --features"));

    let held_out = r.path("held-out.csv");
    let report = done(
        &[
            &["cross-validate"],
            &learn[..],
            &forest[..],
            &["--groups", "container", "--json", "--predictions", text(&held_out)],
        ]
        .concat(),
    );
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["result"]["folds"].as_array().unwrap().len(), 9, "each container once");
    let accuracy = report["result"]["pooled"]["accuracy"].as_f64().unwrap();
    // By simple physics the type is easy to hear; 18 of 57 would be the largest class alone.
    assert!(accuracy > 0.5, "{accuracy}");
    let held_out = std::fs::read_to_string(&held_out).unwrap();
    let rows: Vec<Vec<&str>> = held_out.lines().skip(1).map(|l| l.split(',').collect()).collect();
    let right = rows.iter().filter(|row| row[3] == row[4]).count();
    assert_eq!(rows.len(), 57);
    assert!((right as f64 / 57.0 - accuracy).abs() < 1e-12);
}

/// Forty rows in two classes and four groups, told apart by the first of three features.
pub fn small_table(path: &Path, change: impl FnOnce(&mut Vec<f32>, &mut Vec<String>)) {
    let class = |row: usize| row % 2;
    let mut x: Vec<f32> = (0..40)
        .flat_map(|row| [class(row) as f32 + (row % 5) as f32 * 0.1, (row % 7) as f32, 1.0])
        .collect();
    let mut labels: Vec<String> =
        (0..40).map(|row| if class(row) == 0 { "rice" } else { "water" }.into()).collect();
    change(&mut x, &mut labels);
    let mut npz = NpzWriter::create(path, Compression::Stored).unwrap();
    npz.floats("X", &[40, 3], &x).unwrap();
    npz.floats("mass", &[40], &x[..40]).unwrap();
    npz.strings("type", &labels).unwrap();
    let groups: Vec<String> = (0..40).map(|row| (row / 10).to_string()).collect();
    npz.strings("group", &groups).unwrap();
    let names: Vec<String> = (0..40).map(|row| format!("r{row}")).collect();
    npz.strings("name", &names).unwrap();
    npz.finish().unwrap();
}

#[test]
fn parameters_are_chosen_inside_the_training_rows() {
    let folder = tempfile::tempdir().unwrap();
    let (file, model) = (folder.path().join("x.npz"), folder.path().join("m"));
    small_table(&file, |_, _| {});
    let learn = ["--features", text(&file), "--y", "type", "--groups", "group"];
    let tuned = ["--classifier", "knn", "--standardize", "--tune", "k=19,1"];
    let report = done(&[&["cross-validate", "--json"], &learn[..], &tuned[..]].concat());
    let report: Value = serde_json::from_str(&report).unwrap();
    let folds = report["result"]["folds"].as_array().unwrap();
    assert_eq!(folds.len(), 4);
    for fold in folds {
        let (inner, chosen) = (fold["inner"].as_array().unwrap(), fold["chosen"].as_u64().unwrap());
        let other = inner[1 - chosen as usize].as_f64().unwrap();
        assert!(inner.len() == 2 && inner[chosen as usize].as_f64().unwrap() >= other);
    }
    done(&[&["train"], &learn[..], &tuned[..], &["--out", text(&model)]].concat());
    let bytes = std::fs::read(&model).unwrap();
    let loaded = corsmal_models::model_file::Model::from_bytes(&bytes).unwrap();
    let provenance = &loaded.header().provenance;
    assert_eq!(provenance["choice"]["candidates"].as_array().unwrap().len(), 2);
    assert_eq!(provenance["rows_per_class"], serde_json::json!({"rice": 20, "water": 20}));
    assert!(provenance["files"]["features"]["identity"].as_str().unwrap().contains(':'));

    let table = done(
        &[&["cross-validate", "--cv", "lists=0,1/2,3"], &learn[..], &["--classifier", "tree"]]
            .concat(),
    );
    assert!(table.contains("2 lists of groups (group)"), "{table}");
    for line in ["0,1", "2,3", "95 % CI from", "all together", "rice", "true, predicted"] {
        assert!(table.lines().any(|l| l.starts_with(line)), "{line}: {table}");
    }
}

#[test]
fn what_cannot_be_learned_from_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (file, csv, out) = (at("x.npz"), at("labels.csv"), at("m"));
    small_table(&file, |_, _| {});
    let all: String = (0..40).map(|row| format!("r{row},{}\n", row % 2)).collect();
    let labelled = |lines: &str| {
        std::fs::write(&csv, lines).unwrap();
        refused(&[
            "train",
            "--features",
            text(&file),
            "--ids",
            "name",
            "--labels",
            text(&csv),
            "--target",
            "kind",
            "--classifier",
            "knn",
            "--out",
            text(&out),
        ])
    };
    for (lines, message) in [
        (format!("id,kind\n{}", &all[5..]), "no line for recording \"r0\""),
        (format!("id,kind\n{}r99,1\n", &all[5..]), "line 41 of "),
        (format!("id,kind\n{all}r3,1\n"), "line 42 repeats \"r3\" of line 5"),
        (format!("id,kind\n{}", all.replace(",1", ",1.0")), "kind = \"1.0\" is a decimal number"),
        (
            format!("id,kind\n{}", all.replace("r1,1", "r1,")),
            "labels.csv: r1: label kind = \"\" is empty",
        ),
        (format!("id,kind\n{}", all.replace("r1,1", "r1,2")), "class 2 of kind has 1 row"),
        (format!("id,kind\n{}", all.replace(",1", ",0")), "at least 2 classes are needed"),
        (format!("id,other\n{all}"), "no label column \"kind\""),
        (format!("name,kind\n{all}"), "needs a column id or path"),
        ("id,kind\nr0\n".to_string(), "labels.csv"),
        (
            format!("id,kind\n{}", all.replace("r1,1", "r1,\"1")),
            "labels.csv: line 3: a quotation mark opens here and is never closed",
        ),
    ] {
        let found = labelled(&lines);
        assert!(found.contains(message), "{found}");
    }
    let odd = at("odd.npz");
    let validate = |target: &str, extra: &[&str]| {
        let learn = ["--features", text(&odd), "--target", target, "--classifier", "knn"];
        refused(&[&["cross-validate"], &learn[..], extra].concat())
    };
    let plain = |extra: &[&str]| validate("type", extra);
    small_table(&odd, |x, _| x[3 * 7 + 1] = f32::NAN);
    assert!(plain(&[]).contains("7: feature 1 is NaN (1 row is not finite)"));
    small_table(&odd, |_, labels| labels[0] = "tea".into());
    assert!(plain(&["--cv", "k=4"]).contains("class tea has 1 row, too few for 4"));
    small_table(&odd, |_, _| {});
    let found = plain(&["--groups", "group", "--cv", "k=9"]);
    assert!(
        found.starts_with("warning: ") && found.contains("1 of 3 features have the same value")
    );
    assert!(found.contains("4 groups are too few for 9 folds"), "{found}");
    let open = ["cross-validate", "--features", text(&odd), "--target", "type"];
    let by_group = done(&[&open[..], &["--classifier", "knn"]].concat());
    assert!(by_group.contains("each group once"), "groups are not split: {by_group}");
    assert!(plain(&["--cv", "lists=0/1"]).contains("Name it with --groups"));
    assert!(plain(&["--x", "Z"]).contains("no member \"Z\""));
    assert!(plain(&["--ids", "type"]).contains("id \"rice\" occurs twice"));
    assert!(validate("mass", &[]).contains("is a decimal number"));
    small_table(&odd, |x, _| x.fill(1.0));
    let constant = plain(&["--standardize"]);
    assert!(constant.contains("3 of 3 features have the same value"), "{constant}");
    assert!(constant.contains("has the same value in all"), "{constant}");
    let train = ["train", "--features", text(&odd), "--target", "type", "--classifier", "svm"];
    refused(&[&train[..], &["--standardize", "--out", text(&out)]].concat());
    assert!(!out.exists());
}

/// Columns beside those of [`small_table`], as a label file.
fn label_columns(path: &Path, header: &str, line: impl Fn(usize) -> String) {
    let lines: String = (0..40).map(|row| format!("{row},{}\n", line(row))).collect();
    std::fs::write(path, format!("id,{header}\n{lines}")).unwrap();
}

#[test]
fn groups_are_not_split_by_other_folds() {
    let folder = tempfile::tempdir().unwrap();
    let (file, csv) = (folder.path().join("x.npz"), folder.path().join("l.csv"));
    small_table(&file, |_, _| {});
    label_columns(&csv, "kind,half,cup", |row| format!("{},{},{}", row % 2, row / 20, row / 10));
    let validate = ["cross-validate", "--features", text(&file), "--labels", text(&csv)];
    let learn = ["--target", "kind", "--classifier", "knn", "--groups", "cup"];
    let by = |cv: &'static str| [&validate[..], &learn[..], &["--cv", cv]].concat();
    for plan in ["fold=kind", "group=kind"] {
        let found = refused(&by(plan));
        assert!(found.contains("cup 0 is in the folds 0 and 1; --groups"), "{found}");
    }
    // Training rows are of one half and two cups: only cups can make inner folds.
    let tuned = done(&[&by("fold=half")[..], &["--tune", "k=1,3", "--json"]].concat());
    let report: Value = serde_json::from_str(&tuned).unwrap();
    assert_eq!(report["result"]["folds"].as_array().unwrap().len(), 2);
}

#[test]
fn inner_folds_are_as_many_as_the_smallest_class_allows() {
    let folder = tempfile::tempdir().unwrap();
    let (file, csv) = (folder.path().join("x.npz"), folder.path().join("l.csv"));
    small_table(&file, |_, _| {});
    let arguments = ["cross-validate", "--features", text(&file), "--labels", text(&csv)];
    let learn = ["--target", "kind", "--classifier", "knn", "--cv", "k=2", "--tune", "k=1,3"];
    let validate = [&arguments[..], &learn[..]].concat();
    let rare = |rows: usize| {
        label_columns(&csv, "kind", |row| if row < rows { "rare" } else { "other" }.into());
    };
    rare(4);
    done(&validate);
    rare(2);
    let found = refused(&validate);
    assert!(found.contains("class rare has 1 row for choosing parameters"), "{found}");
}

/// Labels that are one 64-bit float, text in bytes, dates that nobody asked for.
#[test]
fn members_of_other_programs_are_read_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("x.npz");
    let x: Vec<f32> = (0..40).map(|row| row as f32).collect();
    let mut npz = NpzWriter::create(&file, Compression::Stored).unwrap();
    npz.floats("X", &[40, 1], &x).unwrap();
    let mut put = |name: &str, descr: &str, value: &dyn Fn(usize) -> Vec<u8>| {
        let header = Header::new(DType::parse(descr).unwrap(), &[40]);
        npz.array(name, &header, &(0..40).flat_map(value).collect::<Vec<_>>()).unwrap();
    };
    let large = |row: usize| (1u64 << 53) + (row % 2) as u64;
    put("large", "<i8", &|row| large(row).to_le_bytes().to_vec());
    put("larger", "<u8", &|row| ((1u64 << 63) + (row % 2) as u64).to_le_bytes().to_vec());
    put("bytes", "|S1", &|row| vec![b"ab"[row % 2]]);
    put("when", "<f8", &|_| vec![0; 8]);
    npz.finish().unwrap();
    let mut bytes = std::fs::read(&file).unwrap();
    let at = bytes.windows(5).position(|w| w == b"'<f8'").unwrap();
    bytes[at + 2] = b'M';
    std::fs::write(&file, bytes).unwrap();
    let validate = |target: &str| {
        let target = ["--target", target, "--classifier", "knn", "--cv", "k=2", "--json"];
        let report = done(&[&["cross-validate", "--features", text(&file)], &target[..]].concat());
        serde_json::from_str::<Value>(&report).unwrap()["labels"].clone()
    };
    let names = [9_007_199_254_740_992u64, 9_007_199_254_740_993].map(|n| n.to_string());
    assert_eq!(validate("large"), serde_json::json!(names));
    let names = [1u64 << 63, (1 << 63) + 1].map(|n| n.to_string());
    assert_eq!(validate("larger"), serde_json::json!(names));
    assert_eq!(validate("bytes"), serde_json::json!(["a", "b"]));
}

/// A pipe or a device would be replaced by a file.
#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let (file, pipe) = (folder.path().join("x.npz"), folder.path().join("pipe.npz"));
    small_table(&file, |_, _| {});
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let train = ["train", "--features", text(&file), "--target", "type", "--classifier", "knn"];
    let out = ["--out", text(&pipe), "--overwrite"];
    assert!(refused(&[&train[..], &out].concat()).contains("pipe.npz exists and is not a regular"));
    let wav = folder.path().join("a.wav");
    std::fs::write(&wav, "RIFF").unwrap();
    let extract = ["extract", "--in", text(&wav), "--preset", "esc26"];
    assert!(refused(&[&extract[..], &out].concat()).contains("pipe.npz: is not a regular file"));
    assert!(std::fs::metadata(&pipe).unwrap().file_type().is_fifo());
}

#[test]
fn models_that_are_damaged_or_of_other_features_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (file, model) = (folder.path().join("x.npz"), folder.path().join("m"));
    small_table(&file, |_, _| {});
    let learn = ["--features", text(&file), "--target", "type", "--classifier", "logistic"];
    done(&[&["train"], &learn[..], &["--out", text(&model)]].concat());
    let classify = ["classify", "--model", text(&model), "--out", "-"];
    let from_recordings = refused(&[&classify[..], &["--in", text(&file)]].concat());
    assert!(from_recordings.contains("table of another program"), "{from_recordings}");
    let named = refused(&[&classify[..], &["--in", text(&file), "--ids", "name"]].concat());
    assert!(named.contains("recordings have none"), "{named}");
    let by_features = [&classify[..], &["--features", text(&file)]].concat();
    done(&by_features);
    let whole = std::fs::read(&model).unwrap();
    for (damage, message) in [
        (whole[..whole.len() - 1].to_vec(), "bytes; its lengths add up to"),
        ([&whole[..8], &[9], &whole[9..]].concat(), "version 9"),
        ([&whole[..100], &[whole[100] ^ 1], &whole[101..]].concat(), "damaged"),
        (b"hello".to_vec(), "not a model file"),
    ] {
        std::fs::write(&model, damage).unwrap();
        let found = refused(&by_features);
        assert!(found.contains(message) && found.contains(text(&model)), "{found}");
    }
}

/// M5's published forest (its paper: type 93.3, level 69.3 % accuracy) on its own features.
#[test]
fn the_published_forest_is_reached() {
    let shared = std::env::var("CORSMAL_SHARED")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared").to_string());
    let file = Path::new(&shared).join("data/ccm/a34f_train.npz");
    if !file.exists() {
        eprintln!("skipped: {} absent", file.display());
        return;
    }
    for (target, low, high) in [("type", 0.92, 0.95), ("level", 0.68, 0.73)] {
        let report = done(&[
            "cross-validate",
            "--features",
            text(&file),
            "--target",
            target,
            "--groups",
            "container",
            "--cv",
            "lists=1,4,7/2,5,8/3,6,9",
            "--classifier",
            "rf",
            "--set",
            "trees=500",
            "--standardize",
            "--json",
        ]);
        let report: Value = serde_json::from_str(&report).unwrap();
        let accuracy = report["result"]["accuracy"]["mean"].as_f64().unwrap();
        assert!((low..=high).contains(&accuracy), "{target}: {accuracy}");
    }
}
