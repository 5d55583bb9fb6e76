//! Whole outputs: what a run writes, what readers see, merging of shards.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use crate::support::{python, text};
use corsmal_extract::merge::{Existing, merge};
use corsmal_files::layout;
use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzFile, NpzWriter};
use corsmal_files::outcome::{Outcome, Status};
use corsmal_files::parquet::{self, ParquetFile};
use corsmal_files::provenance::Provenance;
use corsmal_files::shard::Shard;
use corsmal_files::table::{Table, TableError};
use proptest::prelude::*;
use tempfile::TempDir;

/// Nobody stops a merge.
static GO: AtomicBool = AtomicBool::new(false);

const NAMES: [&str; 2] = ["mfcc.mean", "zcr.std"];
const INPUTS: usize = 7;

fn names() -> Vec<String> {
    NAMES.map(String::from).to_vec()
}

/// Input 3 is corrupt, the others fine.
fn outcome(index: usize) -> Outcome {
    let id = format!("größe/{index}");
    match index {
        3 => Outcome::new(id, "x.wav", Status::Corrupt, "no fmt chunk"),
        _ => Outcome::new(id, "x.wav", Status::Ok, ""),
    }
}

fn provenance(shard: Shard) -> Provenance {
    Provenance::new("{\"n_fft\":512}".into(), "c0ffee".into(), "beef".into(), shard)
}

fn table(shard: Shard) -> Table {
    let all: Vec<usize> = (0..INPUTS).collect();
    let mut table = Table::new(vec!["level".into()]).unwrap();
    for &index in shard.of(&all) {
        let outcome = outcome(index);
        if outcome.status.has_features() {
            table.name_features(&names()).unwrap();
        }
        let row = if outcome.status.has_features() { vec![index as f32, f32::NAN] } else { vec![] };
        table.push(outcome, &[("level".into(), format!("fu{index}"))], &row).unwrap();
    }
    table
}

fn write_npz(path: &Path, compression: Compression, shard: Shard) {
    let mut writer = NpzWriter::create(path, compression).unwrap();
    let table = table(shard);
    for (id, row) in table.ids().iter().zip(table.values().rows()) {
        let frames = row[0] as usize + 1;
        let values: Vec<f32> = (0..6 * frames).map(|i| i as f32).collect();
        let header = Header::new(DType::F32, &[2, 3, frames]).fortran();
        let name = layout::frames_name(id, None);
        writer.array(&name, &header, bytemuck::cast_slice(&values)).unwrap();
        let times: Vec<f64> = (0..frames).map(|i| i as f64 * 0.01).collect();
        let header = Header::new(DType::F64, &[frames]);
        let name = layout::times_name(id, None);
        writer.array(&name, &header, bytemuck::cast_slice(&times)).unwrap();
    }
    layout::write_table(&mut writer, &table, &provenance(shard)).unwrap();
    writer.finish().unwrap();
}

/// NaN differs from itself, so tables are compared in print.
fn print(table: &Table) -> String {
    format!("{table:?}")
}

fn read_parquet(path: &Path) -> (Table, Provenance) {
    ParquetFile::open(path).unwrap().table().unwrap()
}

#[test]
fn npz_and_parquet_give_the_table_back() {
    let folder = TempDir::new().unwrap();
    let whole = Shard::default();
    let npz = folder.path().join("a.npz");
    for compression in [Compression::Stored, Compression::Deflated] {
        write_npz(&npz, compression, whole);
        let (read, from) = layout::read_table(&mut NpzFile::open(&npz).unwrap()).unwrap();
        assert_eq!(print(&read), print(&table(whole)));
        assert_eq!(from, provenance(whole));
    }
    let file = folder.path().join("a.parquet");
    parquet::write(&file, &table(whole), &provenance(whole)).unwrap();
    let (read, from) = read_parquet(&file);
    assert_eq!(print(&read), print(&table(whole)));
    assert_eq!(from, provenance(whole));
    let first = fs::read(&file).unwrap();
    parquet::write(&file, &table(whole), &provenance(whole)).unwrap();
    assert!(fs::read(&file).unwrap() == first, "equal tables give equal bytes");
}

#[test]
fn an_output_without_rows_is_still_an_output() {
    let folder = TempDir::new().unwrap();
    let mut table = Table::new(vec!["level".into()]).unwrap();
    table.push(outcome(3), &[("level".into(), "x".into())], &[]).unwrap();
    let whole = provenance(Shard::default());
    let npz = folder.path().join("a.npz");
    let mut writer = NpzWriter::create(&npz, Compression::Stored).unwrap();
    layout::write_table(&mut writer, &table, &whole).unwrap();
    writer.finish().unwrap();
    assert_eq!(layout::read_table(&mut NpzFile::open(&npz).unwrap()).unwrap().0, table);
    let file = folder.path().join("a.parquet");
    parquet::write(&file, &table, &whole).unwrap();
    assert_eq!(read_parquet(&file).0, table);
}

#[test]
fn merged_shards_are_the_whole_run_byte_for_byte() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    for compression in [Compression::Stored, Compression::Deflated] {
        write_npz(&path("whole.npz"), compression, Shard::default());
        for count in [1, 2, 3, INPUTS, INPUTS + 2] {
            // Handed over in reverse: the order does not matter.
            let shards: Vec<PathBuf> =
                (0..count).rev().map(|i| path(&format!("{i}.npz"))).collect();
            for (file, index) in shards.iter().rev().zip(0..) {
                write_npz(file, compression, Shard { index, count });
            }
            merge(&shards, &path("merged.npz"), Existing::Overwrite, &GO).unwrap();
            let equal =
                fs::read(path("merged.npz")).unwrap() == fs::read(path("whole.npz")).unwrap();
            assert!(equal, "{count} shards, {compression:?}");
        }
    }
    parquet::write(&path("whole.parquet"), &table(Shard::default()), &provenance(Shard::default()))
        .unwrap();
    let mut shards = Vec::new();
    for index in 0..3 {
        let shard = Shard { index, count: 3 };
        shards.push(path(&format!("{index}.parquet")));
        parquet::write(&shards[index], &table(shard), &provenance(shard)).unwrap();
    }
    merge(&shards, &path("merged.parquet"), Existing::Keep, &GO).unwrap();
    let merged = fs::read(path("merged.parquet")).unwrap();
    assert!(merged == fs::read(path("whole.parquet")).unwrap());
}

#[test]
fn only_the_shards_of_one_run_are_merged() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    for index in 0..2 {
        let name = format!("{index}.npz");
        write_npz(&path(&name), Compression::Stored, Shard { index, count: 2 });
    }
    let out = path("merged.npz");
    let error = merge(&[path("1.npz")], &out, Existing::Keep, &GO).unwrap_err().to_string();
    assert!(error.contains("expected all 2 shards, found 1"), "{error}");
    let error =
        merge(&[path("0.npz"), path("0.npz")], &out, Existing::Keep, &GO).unwrap_err().to_string();
    assert!(error.contains("expected shard 1/2, found 0/2"), "{error}");
    assert!(merge(&[], &out, Existing::Keep, &GO).is_err());
    let mut writer = NpzWriter::create(&path("1.npz"), Compression::Stored).unwrap();
    let shard = Shard { index: 1, count: 2 };
    let other = Provenance { config_hash: "other".into(), ..provenance(shard) };
    layout::write_table(&mut writer, &table(shard), &other).unwrap();
    writer.finish().unwrap();
    let error =
        merge(&[path("0.npz"), path("1.npz")], &out, Existing::Keep, &GO).unwrap_err().to_string();
    assert!(error.contains("1.npz: expected configuration "), "{error}");
    assert!(error.ends_with(", found other"), "{error}");
    // Two hashes help nobody: what differs is named.
    let config = "{\"n_fft\":1024,\"a\":{\"b\":[1]}}".into();
    let other = Provenance { config, ..other };
    let mut writer = NpzWriter::create(&path("1.npz"), Compression::Stored).unwrap();
    layout::write_table(&mut writer, &table(shard), &other).unwrap();
    writer.finish().unwrap();
    let error =
        merge(&[path("0.npz"), path("1.npz")], &out, Existing::Keep, &GO).unwrap_err().to_string();
    let expected = "found other (n_fft: expected 512, found 1024; a.b: expected absent, found [1])";
    assert!(error.ends_with(expected), "{error}");
    assert!(!out.exists());
}

#[test]
fn a_table_keeps_names_and_rows_in_step() {
    let mut table = table(Shard::default());
    let before = print(&table);
    let labels = [("level".to_string(), "x".to_string())];
    let error = table.push(outcome(9), &labels, &[1.0]).unwrap_err();
    assert_eq!(error.to_string(), "größe/9: expected 2 summary values, found 1");
    assert!(matches!(table.push(outcome(9), &[], &[1.0, 2.0]), Err(TableError::Labels { .. })));
    assert!(matches!(table.name_features(&["x".into()]), Err(TableError::Renamed { .. })));
    assert_eq!(print(&table), before);
    assert_eq!(table.ids().len(), INPUTS - 1);
    assert_eq!(table.outcomes().len(), INPUTS);
    assert!(Table::new(vec!["id".into()]).is_err());
    let mut named = Table::new(vec!["level".into()]).unwrap();
    assert!(matches!(named.name_features(&["level".into()]), Err(TableError::Column { .. })));
}

#[test]
fn numpy_reads_what_we_write() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    let script = r#"
import sys, json
with numpy.load(sys.argv[1], allow_pickle=False) as f:
    for name in f.files:
        f[name]
    x = f["größe/4"]
    assert x.dtype == numpy.float32 and x.shape == (2, 3, 5) and x.flags.f_contiguous
    assert (x.ravel(order="F") == numpy.arange(30)).all()
    assert f["__times__/größe/4"].dtype == numpy.float64
    assert f["__ids__"].tolist() == [f"größe/{i}" for i in (0, 1, 2, 4, 5, 6)]
    assert f["__summary__"].shape == (6, 2) and f["__summary_names__"].tolist() == ["mfcc.mean", "zcr.std"]
    assert f["__labels__/level"].tolist()[-1] == "fu6"
    rows = [json.loads(line) for line in f["__outcomes__"].tobytes().decode().splitlines()]
    assert len(rows) == 7 and rows[3]["status"] == "corrupt" and rows[3]["reason"] == "no fmt chunk"
    assert json.loads(f["__config__"].tobytes()) == {"n_fft": 512}
    assert json.loads(f["__meta__"].tobytes())["shard"] == "0/1"
"#;
    for compression in [Compression::Stored, Compression::Deflated] {
        write_npz(&path, compression, Shard::default());
        python(&["numpy"], script, &[text(&path)]);
    }
}

#[test]
fn we_read_what_numpy_writes() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("numpy.npz");
    let script = r#"
import sys
a = numpy.arange(24).reshape(2, 3, 4)
save = numpy.savez_compressed if sys.argv[2] == "deflated" else numpy.savez
arrays = {d: a.astype(d) for d in "b1 i1 u1 <i2 >i4 <i8 >u2 <u8 <f4 >f4 <f8 >f8".split()}
save(sys.argv[1], **arrays, fortran=numpy.asfortranarray(a), scalar=numpy.float64(2.5),
     words=numpy.array(["a", "wörter"]), big=numpy.array(["x"], dtype=">U3"),
     complex=a.astype(complex), half=a.astype("f2"), empty=numpy.zeros((0, 4)))
"#;
    for mode in ["stored", "deflated"] {
        if python(&["numpy"], script, &[text(&path), mode]).is_none() {
            return;
        }
        let mut npz = NpzFile::open(&path).unwrap();
        for name in npz.names().to_vec() {
            let expected = |i: usize| if name == "b1" { (i > 0) as usize } else { i } as f64;
            match name.as_str() {
                "words" => assert_eq!(npz.strings(&name).unwrap(), ["a", "wörter"]),
                "big" => assert_eq!(npz.strings(&name).unwrap(), ["x"]),
                "scalar" => assert_eq!(npz.f32(&name).unwrap()[[]], 2.5),
                "empty" => assert_eq!(npz.f64(&name).unwrap().shape(), [0, 4]),
                "complex" => assert!(npz.f64(&name).is_err()),
                _ => {
                    let array = npz.f64(&name).unwrap();
                    assert_eq!(array.shape(), [2, 3, 4], "{name}");
                    let values: Vec<f64> = array.iter().copied().collect();
                    assert_eq!(values, (0..24).map(expected).collect::<Vec<_>>(), "{name}");
                }
            }
        }
        assert!(!layout::is_ours(&npz));
    }
}

#[test]
fn pandas_and_pyarrow_read_our_parquet() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.parquet");
    parquet::write(&path, &table(Shard::default()), &provenance(Shard::default())).unwrap();
    let script = r#"
import sys, json, pyarrow.parquet
d = pandas.read_parquet(sys.argv[1])
assert list(d.columns) == ["id", "level", "mfcc.mean", "zcr.std"], d.columns
assert d["id"].tolist() == [f"größe/{i}" for i in (0, 1, 2, 4, 5, 6)]
assert d["mfcc.mean"].dtype == "float32" and d["mfcc.mean"].tolist() == [0, 1, 2, 4, 5, 6]
assert d["zcr.std"].isna().all() and d["level"].tolist()[3] == "fu4"
m = pyarrow.parquet.read_schema(sys.argv[1]).metadata
assert json.loads(m[b"corsmal.config"]) == {"n_fft": 512}
assert len(m[b"corsmal.outcomes"].splitlines()) == 7
"#;
    python(&["pandas", "pyarrow"], script, &[text(&path)]);
}

proptest! {
    #[test]
    fn any_damage_to_a_parquet_file_gives_an_answer(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("a.parquet");
        let whole = Shard::default();
        parquet::write(&path, &table(whole), &provenance(whole)).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        for (at, byte) in edits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        fs::write(&path, &bytes).unwrap();
        let _ = ParquetFile::open(&path).and_then(|file| file.table());
    }
}
