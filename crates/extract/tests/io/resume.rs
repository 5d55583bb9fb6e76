//! Interrupted runs: whatever the moment, going on gives the bytes of an undisturbed run.

use std::fs;
use std::path::Path;

use corsmal_extract::ledger::{self, Header, Ledger, LedgerError, Record, ledger_path, part_path};
use corsmal_files::layout;
use corsmal_files::npz::{Compression, NpzWriter};
use corsmal_files::outcome::{Outcome, Status};
use corsmal_files::provenance::Provenance;
use corsmal_files::table::Table;
use proptest::prelude::*;
use tempfile::TempDir;

const INPUTS: usize = 6;

fn header() -> Header {
    Header {
        ledger_version: ledger::VERSION,
        tool_version: "0.1.0".into(),
        config_hash: "c0ffee".into(),
        inputs_hash: "beef".into(),
        shard: "0/1".into(),
        format: "npz stored".into(),
    }
}

fn resume(out: &Path) -> Result<(Ledger, Vec<Record>), LedgerError> {
    Ledger::resume(out, &header(), |_, _| true).map(|(ledger, resumed)| (ledger, resumed.records))
}

/// What an engine does with inputs from the first that is not done until `stop`; the whole run
/// ends with publishing.
fn work(out: &Path, compression: Compression, stop: usize) -> usize {
    let (mut ledger, mut records) = resume(out).unwrap();
    let done = records.len();
    let entries = records.iter().flat_map(|r| r.entries.clone()).collect();
    let (part, path) = ledger.part().unwrap();
    let mut writer = NpzWriter::resume(part, &path, compression, entries).unwrap();
    for index in done..stop.min(INPUTS) {
        let id = format!("rec/{index}");
        let record = if index == 2 {
            let outcome = Outcome::new(id, "x.wav", Status::Empty, "no samples");
            Record { outcome, entries: Vec::new(), row: None, names: None }
        } else {
            let values: Vec<f32> = (0..40 * index).map(|i| (i * index) as f32).collect();
            let frames = writer.floats(&layout::frames_name(&id, None), &[4, 10 * index], &values);
            let times = writer.floats(&layout::times_name(&id, None), &[1], &[index as f32]);
            let row = Some(vec![index as f32 / 3.0, f32::NAN, f32::NEG_INFINITY]);
            let entries = vec![frames.unwrap(), times.unwrap()];
            Record { outcome: Outcome::new(id, "x.wav", Status::Ok, ""), entries, row, names: None }
        };
        ledger.append(&record).unwrap();
        records.push(record);
    }
    if stop <= INPUTS {
        return done;
    }
    let mut table = Table::new(Vec::new()).unwrap();
    table.name_features(&["a", "b", "c"].map(String::from)).unwrap();
    for record in records {
        table.push(record.outcome, &[], &record.row.unwrap_or_default()).unwrap();
    }
    let shard = Default::default();
    let provenance = Provenance::new("{}".into(), "c0ffee".into(), "beef".into(), shard);
    layout::write_table(&mut writer, &table, &provenance).unwrap();
    writer.finish().unwrap();
    ledger.publish().unwrap();
    done
}

fn undisturbed(folder: &Path, compression: Compression) -> Vec<u8> {
    let out = folder.join("undisturbed.npz");
    assert_eq!(work(&out, compression, usize::MAX), 0);
    assert!(!ledger_path(&out).exists() && !part_path(&out).exists());
    fs::read(out).unwrap()
}

fn cut(path: &Path, length: u64) {
    fs::OpenOptions::new().write(true).open(path).unwrap().set_len(length).unwrap();
}

#[test]
fn a_ledger_torn_at_any_byte_gives_its_whole_lines() {
    let folder = TempDir::new().unwrap();
    let expected = undisturbed(folder.path(), Compression::Stored);
    let out = folder.path().join("feats.npz");
    work(&out, Compression::Stored, INPUTS);
    let (ledger, part) = (fs::read(ledger_path(&out)).unwrap(), fs::read(part_path(&out)).unwrap());
    for length in 0..=ledger.len() {
        fs::write(ledger_path(&out), &ledger[..length]).unwrap();
        fs::write(part_path(&out), &part).unwrap();
        let lines = ledger[..length].iter().filter(|&&b| b == b'\n').count();
        let (_, records) = resume(&out).unwrap();
        assert_eq!(records.len(), lines.saturating_sub(1), "cut at {length}");
        // Finishing waits for the disk, so not at every byte.
        if length % 101 == 0 {
            work(&out, Compression::Stored, usize::MAX);
            assert!(fs::read(&out).unwrap() == expected, "cut at {length}");
        }
    }
}

#[test]
fn a_line_of_garbage_ends_what_is_believed() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("feats.npz");
    work(&out, Compression::Stored, INPUTS);
    let text = fs::read_to_string(ledger_path(&out)).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    lines[3] = "\0\0\0\0";
    fs::write(ledger_path(&out), lines.join("\n") + "\n").unwrap();
    let (_, records) = resume(&out).unwrap();
    assert_eq!(records.len(), 2);
    assert_eq!(fs::read_to_string(ledger_path(&out)).unwrap().lines().count(), 3);
}

#[test]
fn rows_come_back_bit_for_bit() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("feats.npz");
    let row = vec![f32::from_bits(0x7fc0_1234), -0.0, f32::MIN_POSITIVE / 3.0, 1e-7, f32::INFINITY];
    let outcome = Outcome::new("a", "a.wav", Status::Ok, "");
    let mut ledger = Ledger::create(&out, &header()).unwrap();
    ledger
        .append(&Record { outcome, entries: vec![], row: Some(row.clone()), names: None })
        .unwrap();
    drop(ledger);
    let (_, records) = resume(&out).unwrap();
    let bits = |row: &[f32]| row.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(records[0].row.as_ref().unwrap()), bits(&row));
}

#[test]
fn another_run_is_not_continued() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("feats.npz");
    assert!(!Ledger::is_pending(&out));
    work(&out, Compression::Stored, 3);
    assert!(Ledger::is_pending(&out));
    let other = Header { config_hash: "decaf".into(), ..header() };
    let error = Ledger::resume(&out, &other, |_, _: &Record| true).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("had configuration c0ffee, this one has decaf"), "{text}");
    fs::write(ledger_path(&out), "a list of eggs\n").unwrap();
    assert!(matches!(resume(&out), Err(LedgerError::Header { .. })));
    let started = Ledger::create(&out, &header()).unwrap();
    started.discard().unwrap();
    assert!(!Ledger::is_pending(&out) && !part_path(&out).exists());
}

/// Every line but the last torn one: a digit of a value, an id, emptied entries, two lines exchanged,
/// one doubled, one left out. What is not as the run wrote it is done again, to the same bytes.
#[test]
fn a_changed_line_is_work_not_done_and_said() {
    let folder = TempDir::new().unwrap();
    let expected = undisturbed(folder.path(), Compression::Stored);
    let out = folder.path().join("feats.npz");
    work(&out, Compression::Stored, INPUTS);
    let (ledger, part) = (fs::read(ledger_path(&out)).unwrap(), fs::read(part_path(&out)).unwrap());
    let text = String::from_utf8(ledger).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let value =
        lines[4].replacen("\"row\":\"", "\"row\":\"1", 1).replacen("0000c07f", "000c07f", 1);
    let id = lines[4].replacen("rec/3", "rec/4", 1);
    let from = lines[4].find("\"entries\":[").unwrap() + 11;
    let until = lines[4].find("],\"row\"").unwrap();
    let empty = format!("{}{}", &lines[4][..from], &lines[4][until..]);
    assert!([&value, &id, &empty].iter().all(|changed| changed.as_str() != lines[4]));
    let with = |line: &str| {
        let mut changed = lines.clone();
        changed[4] = line;
        changed.join("\n")
    };
    let mut exchanged = lines.clone();
    exchanged.swap(4, 5);
    let mut doubled = lines.clone();
    doubled.insert(4, lines[3]);
    let mut left_out = lines.clone();
    left_out.remove(4);
    for changed in [
        with(&value),
        with(&id),
        with(&empty),
        exchanged.join("\n"),
        doubled.join("\n"),
        left_out.join("\n"),
    ] {
        fs::write(ledger_path(&out), changed + "\n").unwrap();
        fs::write(part_path(&out), &part).unwrap();
        let (ledger, resumed) = Ledger::resume(&out, &header(), |_, _: &Record| true).unwrap();
        assert_eq!(resumed.records.len(), 3);
        let said = resumed.dropped.unwrap();
        assert!(said.contains("feats.npz.ledger, line 5: its checksum"), "{said}");
        drop(ledger);
        work(&out, Compression::Stored, usize::MAX);
        assert!(fs::read(&out).unwrap() == expected);
    }
}

#[test]
fn bytes_of_the_archive_that_changed_are_written_again_and_it_is_said() {
    let folder = TempDir::new().unwrap();
    for compression in [Compression::Stored, Compression::Deflated] {
        let expected = undisturbed(folder.path(), compression);
        let out = folder.path().join("feats.npz");
        work(&out, compression, INPUTS);
        let mut part = fs::read(part_path(&out)).unwrap();
        let at = part.len() - 1;
        part[at] ^= 1;
        fs::write(part_path(&out), part).unwrap();
        let (ledger, resumed) = Ledger::resume(&out, &header(), |_, _: &Record| true).unwrap();
        assert_eq!(resumed.records.len(), INPUTS - 1, "{compression:?}");
        assert!(resumed.dropped.unwrap().ends_with("feats.npz.part does not match it"));
        drop(ledger);
        work(&out, compression, usize::MAX);
        assert!(fs::read(&out).unwrap() == expected);
    }
}

/// Another run must not begin beside one whose files were deleted under it, and that one must not
/// publish over it.
#[cfg(unix)]
#[test]
fn a_run_whose_files_were_taken_away_publishes_nothing() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("feats.npz");
    for (gone, locked) in
        [(&[ledger_path(&out)][..], true), (&[ledger_path(&out), part_path(&out)], false)]
    {
        let mut first = Ledger::create(&out, &header()).unwrap();
        gone.iter().for_each(|path| fs::remove_file(path).unwrap());
        let second = Ledger::create(&out, &header());
        assert_eq!(matches!(second, Err(LedgerError::Locked { .. })), locked, "{second:?}");
        let record = Record {
            outcome: Outcome::new("a", "a.wav", Status::Ok, ""),
            entries: vec![],
            row: None,
            names: None,
        };
        let lost = first.append(&record).unwrap_err();
        assert!(matches!(lost, LedgerError::Lost { .. }), "{lost}");
        assert!(matches!(first.publish(), Err(LedgerError::Lost { .. })));
        assert!(!out.exists());
        if let Ok(second) = second {
            second.publish().unwrap();
            assert!(out.exists(), "the other run goes on");
            fs::remove_file(&out).unwrap();
        }
    }
}

#[test]
fn two_runs_cannot_write_one_output() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("feats.npz");
    let first = Ledger::create(&out, &header()).unwrap();
    assert!(matches!(Ledger::create(&out, &header()), Err(LedgerError::Locked { .. })));
    assert!(matches!(resume(&out), Err(LedgerError::Locked { .. })));
    drop(first);
    resume(&out).unwrap();
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    let folder = TempDir::new().unwrap();
    let error = Ledger::create(&folder.path().join("no/feats.npz"), &header()).unwrap_err();
    assert!(error.to_string().contains("no/feats.npz.ledger"), "{error}");
    let out = folder.path().join("feats.npz");
    fs::create_dir(part_path(&out)).unwrap();
    let error = Ledger::create(&out, &header()).unwrap_err();
    assert!(error.to_string().contains("feats.npz.part: "), "{error}");
    assert!(!ledger_path(&out).exists(), "nothing was begun");
}

/// Version 1 had no check sums (0.1.0): it is refused in words, and stays.
#[test]
fn a_ledger_of_an_older_version_is_not_continued() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("feats.npz");
    let old = include_str!("../../../../tests/compat/0.1.0/left.npz.ledger");
    fs::write(ledger_path(&out), old).unwrap();
    let error = resume(&out).unwrap_err().to_string();
    assert!(error.contains("ledger version 1, this one has 2"), "{error}");
    assert_eq!(fs::read_to_string(ledger_path(&out)).unwrap(), old);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Kills at arbitrary points: after some inputs, with the tails of both files lost or replaced
    /// by zeros, several times over.
    #[test]
    fn killed_runs_end_in_the_same_bytes(
        deflated in any::<bool>(),
        kills in prop::collection::vec((0..=INPUTS, 0u64..3000, 0u64..3000, any::<bool>()), 1..4),
    ) {
        let compression = if deflated { Compression::Deflated } else { Compression::Stored };
        let folder = TempDir::new().unwrap();
        let expected = undisturbed(folder.path(), compression);
        let out = folder.path().join("feats.npz");
        for (stop, lost_ledger, lost_part, zeros) in kills {
            work(&out, compression, stop);
            for (path, lost) in [(ledger_path(&out), lost_ledger), (part_path(&out), lost_part)] {
                let length = fs::metadata(&path).unwrap().len();
                cut(&path, length.saturating_sub(lost));
                if zeros {
                    cut(&path, length);
                }
            }
        }
        work(&out, compression, usize::MAX);
        prop_assert!(fs::read(&out).unwrap() == expected);
    }
}

proptest! {
    #[test]
    fn any_ledger_gives_an_answer(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
    ) {
        let folder = TempDir::new().unwrap();
        let out = folder.path().join("feats.npz");
        work(&out, Compression::Stored, 3);
        let mut bytes = fs::read(ledger_path(&out)).unwrap();
        for (at, byte) in edits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        fs::write(ledger_path(&out), &bytes).unwrap();
        if let Ok((ledger, records)) = resume(&out) {
            let entries = records.iter().flat_map(|r| r.entries.clone()).collect();
            let (part, path) = ledger.part().unwrap();
            NpzWriter::resume(part, &path, Compression::Stored, entries).unwrap();
        }
    }
}
