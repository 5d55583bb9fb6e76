mod hostile;

use std::fs;
use std::io::{self, Read, Write};
use std::path::Path;

use proptest::prelude::*;
use tempfile::TempDir;

use super::headers::Zip64;
use super::*;
use crate::npy::{DType, Header};

const COMPRESSIONS: [Compression; 2] = [Compression::Stored, Compression::Deflated];

fn ramp(count: usize) -> Vec<f32> {
    (0..count).map(|i| i as f32 * 0.5 - 3.0).collect()
}

/// A few entries of different lengths and kinds.
fn fill(writer: &mut NpzWriter, from: usize) -> Vec<EntryRecord> {
    let mut records = Vec::new();
    for index in from..5 {
        let data = ramp(index * 100);
        let name = format!("träning/{index}");
        let header = Header::new(DType::F32, &[10, index * 10]).fortran();
        let record = match index % 2 {
            0 => writer.array(&name, &header, bytemuck::cast_slice(&data)),
            _ => {
                writer.array_with(&name, &header, |out| out.write_all(bytemuck::cast_slice(&data)))
            }
        };
        records.push(record.unwrap());
    }
    records
}

fn open(path: &Path) -> fs::File {
    fs::OpenOptions::new().read(true).write(true).open(path).unwrap()
}

fn write(path: &Path, compression: Compression) -> Vec<u8> {
    let mut writer = NpzWriter::create(path, compression).unwrap();
    fill(&mut writer, 0);
    writer.finish().unwrap();
    fs::read(path).unwrap()
}

#[test]
fn what_is_written_is_read_back() {
    let folder = TempDir::new().unwrap();
    for compression in COMPRESSIONS {
        let path = folder.path().join("a.npz");
        write(&path, compression);
        let mut npz = NpzFile::open(&path).unwrap();
        assert_eq!(npz.names().len(), 5);
        let array = npz.f32("träning/3").unwrap();
        assert_eq!(array.shape(), [10, 30]);
        let in_file_order: Vec<f32> = array.t().iter().copied().collect();
        assert_eq!(in_file_order, ramp(300));
        assert_eq!(npz.f64("träning/3").unwrap(), array.mapv(f64::from));
        assert!(npz.f32("träning/0").unwrap().is_empty());
        assert!(
            matches!(npz.f32("other"), Err(NpzError::Missing { member, .. }) if member == "other")
        );
    }
}

#[test]
fn whole_numbers_and_bytes_are_read_as_they_are() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    let mut writer = NpzWriter::create(&path, Compression::Stored).unwrap();
    let mut put = |name: &str, descr: &str, data: &[u8]| {
        let header = Header::new(DType::parse(descr).unwrap(), &[2]);
        writer.array(name, &header, data).unwrap();
    };
    // Neighbours that are one 64-bit float.
    let large = [1u64 << 63, (1 << 63) + 1];
    put("large", "<u8", &large.map(u64::to_le_bytes).concat());
    put("small", ">i4", &[-7i32, 7].map(i32::to_be_bytes).concat());
    put("bytes", "|S3", "ab\0ü\0".as_bytes());
    put("latin", "|S1", b"a\xfc");
    writer.finish().unwrap();
    let mut npz = NpzFile::open(&path).unwrap();
    assert_eq!(npz.integers("large").unwrap().as_slice(), Some(&large.map(i128::from)[..]));
    assert_eq!(npz.integers("small").unwrap().as_slice(), Some(&[-7, 7][..]));
    assert_eq!(npz.strings("bytes").unwrap(), ["ab", "ü"]);
    assert!(npz.strings("latin").unwrap_err().to_string().contains("UTF-8"));
    assert!(npz.integers("bytes").is_err());
}

#[test]
fn text_is_read_back() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    for compression in COMPRESSIONS {
        let strings = ["", "wasser", "水 ü 🜄"];
        let mut writer = NpzWriter::create(&path, compression).unwrap();
        writer.strings("words", &strings).unwrap();
        writer.strings::<&str>("none", &[]).unwrap();
        writer.text("json", "{\"a\": [1, 2]}").unwrap();
        writer.finish().unwrap();
        let mut npz = NpzFile::open(&path).unwrap();
        assert_eq!(npz.strings("words").unwrap(), strings);
        assert!(npz.strings("none").unwrap().is_empty());
        assert_eq!(npz.json::<serde_json::Value>("json").unwrap()["a"][1], 2);
        let error = npz.strings("json").unwrap_err().to_string();
        assert!(
            error.contains("\"json\": expected a list of strings (U or S), found |u1"),
            "{error}"
        );
        assert!(npz.f32("words").unwrap_err().to_string().contains("real numbers"));
    }
}

#[test]
fn data_of_stored_members_is_aligned_and_members_are_what_numpy_saves() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    let bytes = write(&path, Compression::Stored);
    let mut archive = ::zip::ZipArchive::new(io::Cursor::new(&bytes)).unwrap();
    for index in 0..archive.len() {
        let mut member = archive.by_index(index).unwrap();
        let start = member.data_start().unwrap();
        assert_eq!(start % 64, 0, "member {index}");
        let mut content = Vec::new();
        member.read_to_end(&mut content).unwrap();
        let (header, length) = Header::read(&mut content.as_slice()).unwrap();
        assert_eq!(length % 64, 0);
        assert_eq!(content[..length as usize], header.encode());
        assert_eq!(member.last_modified().unwrap().year(), 1980);
    }
}

#[test]
fn streamed_and_whole_arrays_give_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let data = ramp(5000);
    let bytes: &[u8] = bytemuck::cast_slice(&data);
    let header = Header::new(DType::F32, &[5000]);
    for compression in COMPRESSIONS {
        let mut files = Vec::new();
        for piece in [usize::MAX, 7, 4096] {
            let path = folder.path().join("a.npz");
            let mut writer = NpzWriter::create(&path, compression).unwrap();
            match piece {
                usize::MAX => writer.array("x", &header, bytes).unwrap(),
                _ => writer
                    .array_with("x", &header, |out| {
                        bytes.chunks(piece).try_for_each(|piece| out.write_all(piece))
                    })
                    .unwrap(),
            };
            writer.finish().unwrap();
            files.push(fs::read(&path).unwrap());
        }
        if compression == Compression::Deflated {
            let path = folder.path().join("a.npz");
            let mut writer = NpzWriter::create(&path, compression).unwrap();
            let short = Packed::deflate(&header, &bytes[1..]);
            assert!(writer.packed("x", &short).is_err());
            writer.packed("x", &Packed::deflate(&header, bytes)).unwrap();
            writer.finish().unwrap();
            files.push(fs::read(&path).unwrap());
        }
        assert!(files.iter().all(|file| *file == files[0]), "{compression:?}");
    }
}

#[test]
fn a_failed_entry_leaves_no_trace() {
    let folder = TempDir::new().unwrap();
    for compression in COMPRESSIONS {
        let expected = write(&folder.path().join("a.npz"), compression);
        let path = folder.path().join("b.npz");
        let mut writer = NpzWriter::create(&path, compression).unwrap();
        let header = Header::new(DType::F32, &[10]);
        let failures: [NpzError; 3] = [
            writer.array("x", &header, &[0; 39]).unwrap_err(),
            writer.array_with("x", &header, |out| out.write_all(&[0; 41])).unwrap_err(),
            writer
                .array_with("x", &header, |out| {
                    out.write_all(&[1; 5000])?;
                    Err(io::Error::other("source broke"))
                })
                .unwrap_err(),
        ];
        assert!(
            failures[0].to_string().contains("expected 40 bytes of data for shape [10], found 39")
        );
        assert!(failures[1].to_string().contains("found 41"));
        assert!(failures[2].to_string().contains("source broke"));
        fill(&mut writer, 0);
        writer.finish().unwrap();
        assert!(fs::read(&path).unwrap() == expected, "{compression:?}");
    }
}

#[test]
fn a_partial_archive_is_continued_to_the_same_bytes_from_any_length() {
    let folder = TempDir::new().unwrap();
    for compression in COMPRESSIONS {
        let whole = folder.path().join("whole.npz");
        let mut writer = NpzWriter::create(&whole, compression).unwrap();
        let records = fill(&mut writer, 0);
        writer.finish().unwrap();
        let expected = fs::read(&whole).unwrap();
        let part = folder.path().join("part");
        for length in (0..=expected.len()).step_by(61) {
            fs::write(&part, &expected[..length]).unwrap();
            let sound = intact_entries(&open(&part), &records).unwrap();
            let complete = records.iter().take_while(|r| r.end <= length as u64).count();
            assert_eq!(sound, complete, "{compression:?} cut at {length}");
            let kept = records[..sound].to_vec();
            let mut writer = NpzWriter::resume(open(&part), &part, compression, kept).unwrap();
            fill(&mut writer, sound);
            writer.finish().unwrap();
            assert!(fs::read(&part).unwrap() == expected, "{compression:?} cut at {length}");
        }
    }
}

/// Any bit: the last byte of a deflate stream has some that mean nothing.
#[test]
fn damage_inside_an_entry_is_seen() {
    let folder = TempDir::new().unwrap();
    for compression in COMPRESSIONS {
        let path = folder.path().join("a.npz");
        let mut writer = NpzWriter::create(&path, compression).unwrap();
        let records = fill(&mut writer, 0);
        drop(writer);
        let intact = fs::read(&path).unwrap();
        assert_eq!(intact_entries(&open(&path), &records).unwrap(), 5);
        let (third, end) = (&records[2], records[2].end as usize);
        let middle = (third.offset as usize + end) / 2;
        for (at, bit) in (0..8).map(|bit| (end - 1, bit)).chain([(middle, 3)]) {
            let mut damaged = intact.clone();
            damaged[at] ^= 1 << bit;
            fs::write(&path, damaged).unwrap();
            let found = intact_entries(&open(&path), &records).unwrap();
            assert_eq!(found, 2, "{compression:?}: bit {bit} of byte {at}");
        }
        let gap = records[1..].to_vec();
        let resumed = NpzWriter::resume(open(&path), &path, compression, gap);
        let error = resumed.unwrap_err().to_string();
        assert!(error.contains("expected an entry from byte 0"), "{error}");
    }
}

#[test]
fn zip64_records_are_understood() {
    let folder = TempDir::new().unwrap();
    for compression in COMPRESSIONS {
        for zip64 in [Zip64 { size: 200, entries: 3 }, Zip64 { size: 0, entries: u64::MAX }] {
            let path = folder.path().join("a.npz");
            let mut writer = NpzWriter::create(&path, compression).unwrap().with_zip64(zip64);
            fill(&mut writer, 0);
            writer.finish().unwrap();
            let mut npz = NpzFile::open(&path).unwrap();
            assert_eq!(npz.names().len(), 5);
            assert_eq!(npz.f32("träning/4").unwrap().len(), 400);
            python_opens(&path);
        }
    }
}

/// Lets Python's zip reader check every member, if there is a Python.
fn python_opens(path: &Path) {
    let program = std::env::var("CORSMAL_PYTHON").unwrap_or_else(|_| "python3".into());
    let script = "import sys, zipfile; z = zipfile.ZipFile(sys.argv[1]); \
                  assert z.testzip() is None and len(z.namelist()) == 5";
    match std::process::Command::new(&program).arg("-c").arg(script).arg(path).status() {
        Ok(status) => assert!(status.success()),
        Err(_) => println!("skipped: {program} absent"),
    }
}

/// More than 65,535 members, for which zip64 is a must.
#[test]
fn more_members_than_plain_zip_can_count() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("many.npz");
    let mut writer = NpzWriter::create(&path, Compression::Stored).unwrap();
    for index in 0..65_540 {
        writer.floats(&index.to_string(), &[], &[index as f32]).unwrap();
    }
    writer.finish().unwrap();
    let mut npz = NpzFile::open(&path).unwrap();
    assert_eq!(npz.names().len(), 65_540);
    assert_eq!(npz.f32("65539").unwrap()[[]], 65_539.0);
}

#[test]
fn half_precision_and_complex_numbers_are_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    let mut writer = NpzWriter::create(&path, Compression::Stored).unwrap();
    // 1.5, -2, the smallest subnormal, infinity.
    let bits = [0x3e00u16, 0xc000, 0x0001, 0x7c00];
    let bytes: Vec<u8> = bits.iter().flat_map(|b| b.to_be_bytes()).collect();
    let half = DType::parse(">f2").unwrap();
    writer.array("half", &Header::new(half, &[4]), &bytes).unwrap();
    let parts = ramp(12);
    let part = |i: usize| f64::from(parts[i]);
    let header = Header::new(DType::C64, &[2, 3]);
    writer.array("c", &header, bytemuck::cast_slice(&parts)).unwrap();
    writer.array("fortran", &header.fortran(), bytemuck::cast_slice(&parts)).unwrap();
    writer.finish().unwrap();
    let mut npz = NpzFile::open(&path).unwrap();
    let values: Vec<f64> = npz.f64("half").unwrap().into_iter().collect();
    assert_eq!(values, [1.5, -2.0, 2f64.powi(-24), f64::INFINITY]);
    assert_eq!(npz.f32("half").unwrap()[1], -2.0);
    assert!(npz.f64("c").unwrap_err().to_string().contains("real numbers"));
    let (c, fortran) = (npz.components("c").unwrap(), npz.components("fortran").unwrap());
    assert_eq!((c.shape(), fortran.shape()), (&[2, 2, 3][..], &[2, 2, 3][..]));
    // Element [1, 0] is number 3 in C order and number 1 in Fortran order.
    assert_eq!([c[[0, 1, 0]], c[[1, 1, 0]]], [part(6), part(7)]);
    assert_eq!([fortran[[0, 1, 0]], fortran[[1, 1, 0]]], [part(2), part(3)]);
    assert_eq!(npz.components("half").unwrap().shape(), [4]);
}
