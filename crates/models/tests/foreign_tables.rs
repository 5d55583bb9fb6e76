//! Tables of other programs: which member names the rows, and which are labels.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;

use corsmal_files::layout;
use corsmal_files::npz::{Compression, NpzWriter};
use corsmal_files::outcome::{Outcome, Status};
use corsmal_files::provenance::Provenance;
use corsmal_files::shard::Shard;
use corsmal_files::table::Table;
use corsmal_models::dataset::{LabelSource, LabelledTable, MemberNames, Result};

const LABELS: &str = "id,class\na,cat\nb,dog\nc,hen\n";

/// Three rows with ids under some name, and the classes of a label file.
fn classes(member: &str, ids: [&str; 3], labels: &str) -> Result<Vec<String>> {
    let folder = tempfile::tempdir().unwrap();
    let (path, csv) = (folder.path().join("x.npz"), folder.path().join("l.csv"));
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    npz.floats("X", &[3, 1], &[0.0, 1.0, 2.0]).unwrap();
    npz.strings(member, &ids).unwrap();
    npz.finish().unwrap();
    std::fs::write(&csv, labels).unwrap();
    let mut table = LabelledTable::read(&path, &MemberNames::default())?;
    table.add_labels(&LabelSource::File { path: csv, key: None })?;
    table.column("class")
}

#[test]
fn labels_go_to_the_rows_that_the_file_names() {
    for member in ["id", "ids"] {
        let found = classes(member, ["c", "a", "b"], LABELS).unwrap();
        assert_eq!(found, ["hen", "cat", "dog"], "{member}");
    }
    // Without ids rows are numbered.
    let numbered = LABELS.replace("a,", "0,").replace("b,", "1,").replace("c,", "2,");
    assert_eq!(classes("name", ["c", "a", "b"], &numbered).unwrap(), ["cat", "dog", "hen"]);
    // Where ids would not do, nothing is guessed.
    for (ids, why) in
        [(["c", "c", "b"], "id \"c\" occurs twice"), (["c", "", "b"], "row 1 has no id")]
    {
        let refused = classes("id", ids, &numbered).unwrap_err().to_string();
        assert!(refused.contains("only numbered") && refused.contains(why), "{refused}");
    }
}

#[test]
fn members_that_are_no_columns_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    npz.floats("X", &[3, 1], &[0.0, 1.0, 2.0]).unwrap();
    npz.floats("y", &[3, 1], &[0.0, 1.0, 2.0]).unwrap();
    npz.strings("short", &["a", "b"]).unwrap();
    npz.finish().unwrap();
    let table = LabelledTable::read(&path, &MemberNames::default()).unwrap();
    for (name, shape) in [("y", "[3, 1]"), ("short", "[2]")] {
        let refused = table.column(name).unwrap_err().to_string();
        assert!(refused.contains(&format!("has shape {shape}, expected [3]")), "{refused}");
    }
    let named = MemberNames { ids: Some("y".into()), ..MemberNames::default() };
    let refused = LabelledTable::read(&path, &named).unwrap_err().to_string();
    assert!(refused.contains("--ids") && refused.contains("has shape [3, 1]"), "{refused}");
}

#[test]
fn names_of_members_are_refused_for_our_own_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ours.npz");
    let mut table = Table::new(Vec::new()).unwrap();
    table.name_features(&["loudness".into()]).unwrap();
    table.push(Outcome::new("a", "a.wav", Status::Ok, ""), &[], &[0.5]).unwrap();
    let made = Provenance::new("{}".into(), "hash".into(), "inputs".into(), Shard::default());
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    layout::write_table(&mut npz, &table, &made).unwrap();
    npz.finish().unwrap();
    let read = |x: &str, ids: Option<&str>| {
        LabelledTable::read(&path, &MemberNames { x: x.into(), ids: ids.map(String::from) })
    };
    assert_eq!(read("X", None).unwrap().ids, ["a"]);
    for (x, ids) in [("Y", None), ("X", Some("id"))] {
        let refused = read(x, ids).unwrap_err().to_string();
        assert!(refused.contains("--x and --ids are for files from other programs"), "{refused}");
    }
    let folder = LabelledTable::read(folder.path(), &MemberNames::default()).unwrap_err();
    assert!(folder.to_string().contains("--preset mfcc-zcr"), "{folder}");
    assert!(LabelledTable::read(Path::new("none.npz"), &MemberNames::default()).is_err());
}

#[test]
fn faults_of_joint_classes_name_the_file_of_their_part() {
    let folder = tempfile::tempdir().unwrap();
    let (path, csv) = (folder.path().join("x.npz"), folder.path().join("l.csv"));
    let refused = |own: &[(&str, [&str; 3])], labels: &str| {
        let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
        npz.floats("X", &[3, 1], &[0.0, 1.0, 2.0]).unwrap();
        npz.strings("id", &["a", "b", "c"]).unwrap();
        for (name, values) in own {
            npz.strings(name, values).unwrap();
        }
        npz.finish().unwrap();
        std::fs::write(&csv, labels).unwrap();
        let mut table = LabelledTable::read(&path, &MemberNames::default()).unwrap();
        table.add_labels(&LabelSource::File { path: csv.clone(), key: None }).unwrap();
        table.classes("joint").unwrap_err().to_string()
    };
    let (features, labels) = (path.display().to_string(), csv.display().to_string());
    for (own, lines, file, what) in [
        (&[][..], "id,type,level\na,1,2\nb,1,\nc,1,2\n", &labels, "b: label level = \"\" is empty"),
        (&[], "id,type,level\na,1,2\nb,1,2\nc,1,2\n", &labels, "all rows have joint = 1-2"),
        (
            &[("type", ["1", "", "2"])],
            "id,level\na,1\nb,1\nc,1\n",
            &features,
            "b: label type = \"\" is empty",
        ),
        (&[("type", ["1"; 3])], "id,level\na,1\nb,1\nc,1\n", &labels, "all rows have joint = 1-1"),
    ] {
        let message = refused(own, lines);
        assert!(message.starts_with(&format!("{file}: {what}")), "{message}");
    }
}

/// Named ids were a label as well, and those of Parquet were not found.
#[test]
fn named_ids_are_no_labels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    npz.floats("X", &[3, 1], &[0.0, 1.0, 2.0]).unwrap();
    npz.strings("ids", &["a", "b", "c"]).unwrap();
    npz.finish().unwrap();
    let named = MemberNames { ids: Some("ids".into()), ..MemberNames::default() };
    let table = LabelledTable::read(&path, &named).unwrap();
    assert_eq!(table.ids, ["a", "b", "c"]);
    assert!(table.column("ids").is_err());
}
