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

/// What an engine does with inputs from the first that is not done until `stop`; the whole run
/// ends with publishing.
fn work(out: &Path, compression: Compression, stop: usize) -> usize {
    let (mut ledger, mut records) = Ledger::resume(out, &header(), |_, _| true).unwrap();
    let done = records.len();
    let entries = records.iter().flat_map(|r| r.entries.clone()).collect();
    let mut writer = NpzWriter::resume(&ledger.part(), compression, entries).unwrap();
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
        let (_, records) = Ledger::resume(&out, &header(), |_, _| true).unwrap();
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
    let (_, records) = Ledger::resume(&out, &header(), |_, _| true).unwrap();
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
    let (_, records) = Ledger::resume(&out, &header(), |_, _| true).unwrap();
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
    let error = Ledger::resume(&out, &other, |_, _| true).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("had configuration c0ffee, this one has decaf"), "{text}");
    fs::write(ledger_path(&out), "a list of eggs\n").unwrap();
    assert!(matches!(
        Ledger::resume(&out, &header(), |_, _| true),
        Err(LedgerError::Header { .. })
    ));
    let started = Ledger::create(&out, &header()).unwrap();
    started.discard().unwrap();
    assert!(!Ledger::is_pending(&out) && !part_path(&out).exists());
}

#[test]
fn two_runs_cannot_write_one_output() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("feats.npz");
    let first = Ledger::create(&out, &header()).unwrap();
    assert!(matches!(Ledger::create(&out, &header()), Err(LedgerError::Locked { .. })));
    assert!(matches!(
        Ledger::resume(&out, &header(), |_, _| true),
        Err(LedgerError::Locked { .. })
    ));
    drop(first);
    Ledger::resume(&out, &header(), |_, _| true).unwrap();
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    let folder = TempDir::new().unwrap();
    let error = Ledger::create(&folder.path().join("no/feats.npz"), &header()).unwrap_err();
    assert!(error.to_string().contains("no/feats.npz.ledger"), "{error}");
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
        if let Ok((ledger, records)) = Ledger::resume(&out, &header(), |_, _| true) {
            let entries = records.iter().flat_map(|r| r.entries.clone()).collect();
            NpzWriter::resume(&ledger.part(), Compression::Stored, entries).unwrap();
        }
    }
}
