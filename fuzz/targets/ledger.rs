//! The ledger of an interrupted run with check sums that are right, and any partial output: a length
//! of four bytes, the text of the records, the output. What is believed can be gone on with.
#![no_main]

use std::fs;

use corsmal_extract::ledger::{self, Header, Ledger, Record, ledger_path, part_path};
use corsmal_files::npz::{Compression, NpzWriter};

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    let Some((length, rest)) = bytes.split_first_chunk() else { return };
    let (text, part) = rest.split_at((u32::from_le_bytes(*length) as usize).min(rest.len()));
    let header = Header {
        ledger_version: ledger::VERSION,
        tool_version: "0.1.0".into(),
        config_hash: "c0ffee".into(),
        inputs_hash: "beef".into(),
        shard: "0/1".into(),
        format: "npz stored".into(),
    };
    let out = corsmal_fuzz::folder().join("out.npz");
    let _ = fs::remove_file(ledger_path(&out));
    drop(Ledger::create(&out, &header).expect("a new ledger"));
    // The chain of check sums goes on behind the header.
    let mut file = fs::read(ledger_path(&out)).expect("it was written");
    let mut chain = [0; 32];
    let mut sum = |text: &[u8]| {
        let mut hasher = blake3::Hasher::new();
        chain = *hasher.update(&chain).update(text).finalize().as_bytes();
        chain[..16].iter().map(|byte| format!("{byte:02x}")).collect::<String>()
    };
    let first = file.strip_suffix(b"\n").expect("a whole line");
    assert_eq!(sum(&first[33..]).as_bytes(), &first[..32], "the ledger has another chain");
    for line in text.split(|byte| *byte == b'\n') {
        file.extend(sum(line).as_bytes());
        file.push(b' ');
        file.extend(line);
        file.push(b'\n');
    }
    fs::write(ledger_path(&out), file).expect("room");
    fs::write(part_path(&out), part).expect("room");
    let Ok((ledger, resumed)) = Ledger::resume::<Record>(&out, &header, |_, _| true) else { return };
    let entries = resumed.records.into_iter().flat_map(|record| record.entries).collect();
    let (file, path) = ledger.part().expect("an open file");
    if let Ok(mut writer) = NpzWriter::resume(file, &path, Compression::Stored, entries) {
        let _ = writer.floats("more", &[2], &[1.0, 2.0]);
        let _ = writer.finish();
    }
});
