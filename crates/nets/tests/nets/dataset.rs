//! Inputs of networks from files.

use corsmal_files::npy::{DType, Header, Kind};
use corsmal_files::npz::{Compression, NpzWriter};
use corsmal_nets::dataset::Dataset;
use corsmal_nets::networks;

#[test]
fn items_of_another_layout_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let refuse = |name: &str, shape: &[usize], offsets: Option<&[i64]>, expected: &str| {
        let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
        npz.floats("X", shape, &vec![0.5; shape.iter().product()]).unwrap();
        if let Some(offsets) = offsets {
            let bytes: Vec<u8> = offsets.iter().flat_map(|v| v.to_le_bytes()).collect();
            let header = Header::new(DType::parse("<i8").unwrap(), &[offsets.len()]);
            npz.array("offsets", &header, &bytes).unwrap();
        }
        npz.finish().unwrap();
        let network = networks::named(name).unwrap().build(None, 0).unwrap();
        let text = Dataset::read(&path, &network).unwrap_err().to_string();
        assert!(text.contains(expected), "{text}");
    };
    // All have as many numbers an item as the network takes.
    refuse("m5_vggish_level", &[2, 128, 6], None, "expected [items, steps, 128]");
    refuse("m5_vggish_level", &[2, 640], None, "expected [items, steps, 128]");
    refuse("m5_vggish_level", &[4, 2, 64], Some(&[0, 1, 4]), "expected [rows, 128]");
    refuse("m1", &[2, 41, 50], None, "expected [items, 2050]");
    refuse("m1", &[2, 2050], Some(&[0, 1, 2]), "m1 takes no sequences");
    refuse("m6_action", &[2, 9216], None, "expected [items, 1, 96, 96]");
}

/// The error asked for real numbers, found those, and named the file twice.
#[test]
fn offsets_of_a_floating_point_type_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    npz.floats("X", &[2, 128], &[0.5; 256]).unwrap();
    npz.floats("offsets", &[2], &[0.0, 2.0]).unwrap();
    npz.finish().unwrap();
    let network = networks::named("m5_vggish_level").unwrap().build(None, 0).unwrap();
    let text = Dataset::read(&path, &network).unwrap_err().to_string();
    assert!(
        text.contains("offsets") && text.contains("expected whole numbers (b, i, u)"),
        "{text}"
    );
    assert_eq!(text.matches("x.npz").count(), 1, "{text}");
}

#[test]
fn a_member_id_names_the_items() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let network = networks::named("m1").unwrap().build(None, 0).unwrap();
    for (ids, expected) in [(["b", "a"], ["b", "a"]), (["b", "b"], ["0", "1"])] {
        let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
        npz.floats("X", &[2, 2050], &[0.0; 4100]).unwrap();
        npz.strings("id", &ids).unwrap();
        npz.finish().unwrap();
        assert_eq!(Dataset::read(&path, &network).unwrap().ids, expected);
    }
}

/// Rows had the names 0, 1, ... in silence.
#[test]
fn too_few_ids_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let network = networks::named("m1").unwrap().build(None, 0).unwrap();
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    npz.floats("X", &[2, 2050], &[0.0; 4100]).unwrap();
    npz.strings("ids", &["a"]).unwrap();
    npz.finish().unwrap();
    let said = Dataset::read(&path, &network).unwrap_err().to_string();
    assert!(said.contains("ids: expected a value for each of the 2 items"), "{said}");
}

#[test]
fn views_of_a_recording_have_the_same_labels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let network = networks::named("m5_r21d_level").unwrap().build(None, 0).unwrap();
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    npz.floats("X", &[4, 512], &[0.0; 2048]).unwrap();
    let header = Header::new(DType { kind: Kind::Int, itemsize: 8, big_endian: false }, &[5]);
    let ends: Vec<u8> = (0..5i64).flat_map(i64::to_le_bytes).collect();
    npz.array("offsets", &header, &ends).unwrap();
    npz.strings("ids", &["a"; 4]).unwrap();
    npz.strings("level", &["0", "1", "0", "0"]).unwrap();
    npz.strings("view", &["1", "2", "3", "4"]).unwrap();
    npz.finish().unwrap();
    let said = Dataset::read(&path, &network).unwrap_err().to_string();
    assert!(
        said.contains("has no view 2; rows of one recording have the same ids, level"),
        "{said}"
    );
}

#[test]
fn members_of_other_names_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    npz.floats("X", &[2, 2050], &[0.0; 4100]).unwrap();
    npz.floats("other", &[2, 2050], &[1.0; 4100]).unwrap();
    npz.strings("file", &["a", "b"]).unwrap();
    npz.finish().unwrap();
    let network = networks::named("m1").unwrap().build(None, 0).unwrap();
    let data = Dataset::read_members(&path, &network, "other", Some("file")).unwrap();
    assert_eq!(
        (data.ids, data.items.columns[0].values[0]),
        (vec!["a".to_owned(), "b".to_owned()], 1.0)
    );
    for (x, ids) in [("none", None), ("X", Some("none")), ("X", Some("other"))] {
        let error = Dataset::read_members(&path, &network, x, ids).unwrap_err();
        assert!(error.to_string().contains(ids.unwrap_or(x)), "{error}");
    }
}
