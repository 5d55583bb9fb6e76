//! Outputs partitioned by a label.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use corsmal_files::feature_file::FeatureTable;
use corsmal_files::partition;

use super::support::{Ended, ended, extract, extraction, wav};
use crate::command::{done, names, text};

/// A manifest of recordings of three kinds.
fn manifest(folder: &Path, count: usize) -> std::path::PathBuf {
    let mut rows = String::from("path,type\n");
    for i in 0..count {
        let name = format!("r{i:03}.wav");
        wav(&folder.join(&name), 2, 6000 + i, i as u32);
        rows.push_str(&format!("{name},{}\n", ["rice", "water", "a=b/c"][i % 3]));
    }
    let path = folder.join("list.csv");
    fs::write(&path, rows).unwrap();
    path
}

/// Every file of a folder and of those in it, with its bytes.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for part in names(folder) {
        for name in names(&folder.join(&part)) {
            all.push((format!("{part}/{name}"), fs::read(folder.join(&part).join(name)).unwrap()));
        }
    }
    all
}

#[test]
fn parts_appear_together_and_are_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let list = manifest(folder.path(), 30);
    let at = |name: &str| folder.path().join(name);
    for more in [&["--preset", "mfcc-zcr"][..], &[]] {
        extract(&list, &at("whole.parquet"), &[more, &["--overwrite"]].concat()).with(0);
        let by = [more, &["--partition-by", "type"]].concat();
        let run = |out: &str, more: &[&str]| -> Ended {
            extract(&list, &at(out), &[&by[..], more].concat())
        };
        run("parts", &["--overwrite"]).with(0);
        assert_eq!(names(&at("parts")), ["type=a%3Db%2Fc", "type=rice", "type=water"]);
        let (joined, label) = partition::open(&at("parts")).unwrap();
        assert_eq!(
            (joined.table, label.as_str()),
            (FeatureTable::open(&at("whole.parquet")).unwrap().table, "type")
        );
        // Again, and with a slash.
        let again = ended(extraction(&list, &at("parts/"), &by).stdin(Stdio::null())).with(0);
        assert!(again.stderr.contains("up to date"), "{}", again.stderr);
        // One label does not stand for the other, and other recordings are other ones.
        let other = run("parts", &["--window", "0.2", "--hop", "0.2"]).with(2);
        assert!(other.stderr.contains("other inputs"), "{}", other.stderr);
        let told = done(&["inspect", text(&at("parts"))]);
        assert!(told.contains("parquet files") && told.contains("30 inputs: 30 ok"), "{told}");
        assert!(told.contains("type: "), "{told}");

        // Killed, and gone on with.
        let expected = files(&at("parts"));
        let mut killed = extraction(&list, &at("again"), &[&by[..], &["--jobs", "1"]].concat())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let ledger = at("again.ledger");
        while fs::read(&ledger).map_or(0, |text| text.len()) < 1000
            && killed.try_wait().unwrap().is_none()
        {
            std::thread::sleep(std::time::Duration::from_micros(200));
        }
        killed.kill().unwrap();
        killed.wait().unwrap();
        assert!(!at("again").exists(), "too fast for the test");
        run("again", &["--resume"]).with(0);
        assert!(files(&at("again")) == expected);
        let left = names(folder.path()).into_iter().filter(|name| name.starts_with("again."));
        assert_eq!(left.collect::<Vec<_>>(), Vec::<String>::new());
        run("again", &["--overwrite"]).with(0);
        assert!(files(&at("again")) == expected);
        fs::remove_dir_all(at("again")).unwrap();
        fs::remove_dir_all(at("parts")).unwrap();
    }
}

#[test]
fn what_cannot_be_partitioned_is_refused_and_nothing_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let list = manifest(folder.path(), 3);
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("mine")).unwrap();
    fs::write(at("mine/notes.txt"), "mine").unwrap();
    fs::write(at("file"), "mine").unwrap();
    fs::create_dir(at("empty")).unwrap();
    let run = |out: &str, more: &[&str]| {
        extract(&list, &at(out), &[&["--preset", "mfcc-zcr", "--overwrite"], more].concat())
    };
    for (out, label, reason) in [
        ("mine", "type", "is not a partitioned output"),
        ("file", "type", "is not a partitioned output"),
        ("x.npz", "type", "the name of an .npz"),
        ("none/x", "type", "there is no folder"),
        ("x", "kind", "the labels of the inputs are type"),
    ] {
        let refused = run(out, &["--partition-by", label]).with(2);
        assert!(refused.stderr.contains(reason), "{out}: {}", refused.stderr);
    }
    assert_eq!(fs::read_to_string(at("mine/notes.txt")).unwrap(), "mine");
    // Neighbours with names that one might think of stay.
    for name in ["empty.parts", "empty.replaced"] {
        fs::create_dir(at(name)).unwrap();
        fs::write(at(name).join("notes.txt"), "mine").unwrap();
    }
    run("empty", &["--partition-by", "type"]).with(0);
    assert_eq!(names(&at("empty")).len(), 3);
    run("empty", &["--partition-by", "type"]).with(0);
    for name in ["empty.parts", "empty.replaced"] {
        assert_eq!(fs::read_to_string(at(name).join("notes.txt")).unwrap(), "mine");
    }
    assert!(!names(folder.path()).iter().any(|name| name.starts_with(".empty")));
    for (values, reason) in [
        (["Rice", "rice"], "would share a folder"),
        (["1", "01"], "read as the same number"),
        (["", "__HIVE_DEFAULT_PARTITION__"], "would share a folder"),
        ([&*"水".repeat(29), "x"], "too long for the name of a folder"),
    ] {
        let rows = format!("path,type\nr000.wav,{}\nr001.wav,{}\n", values[0], values[1]);
        fs::write(at("odd.csv"), rows).unwrap();
        let more = ["--preset", "mfcc-zcr", "--partition-by", "type"];
        let refused = extract(&at("odd.csv"), &at("odd"), &more).with(2);
        assert!(refused.stderr.contains(reason), "{}", refused.stderr);
    }
    let unlabelled =
        extract(&at("r000.wav"), &at("x"), &["--preset", "mfcc-zcr", "--partition-by", "type"]);
    assert!(unlabelled.with(2).stderr.contains("have no labels"));
}

#[test]
fn a_shard_without_recordings_is_an_output_too() {
    let folder = tempfile::tempdir().unwrap();
    let list = manifest(folder.path(), 2);
    let out = folder.path().join("shard");
    for more in [&["--preset", "mfcc-zcr"][..], &[]] {
        let by = ["--partition-by", "type", "--shard", "0/3", "--overwrite"];
        extract(&list, &out, &[more, &by].concat()).with(0);
        assert_eq!(names(&out), ["type=__HIVE_DEFAULT_PARTITION__"]);
        let (found, label) = partition::open(&out).unwrap();
        assert_eq!((found.table.outcomes().len(), label.as_str()), (0, "type"));
        let told = done(&["inspect", text(&out)]);
        assert!(told.contains("0 inputs"), "{told}");
        let again = extract(&list, &out, &[more, &by[..4]].concat()).with(0);
        assert!(again.stderr.contains("up to date"), "{}", again.stderr);
    }
}
