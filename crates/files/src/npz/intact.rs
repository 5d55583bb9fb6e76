//! Tells which entries of an interrupted archive are intact.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use super::entry::EntryRecord;
use super::headers::{self, Zip64};

const CHUNK: usize = 1 << 20;

/// How many of `entries`, from the first on, a partial archive really holds: local header and stored
/// bytes of each are checked, so that neither a kill nor a power cut passes for finished work. Reads
/// the file once.
///
/// # Errors
/// What reading reports, the end of the file excepted.
pub fn intact_entries(mut file: &File, entries: &[EntryRecord]) -> io::Result<usize> {
    let length = file.metadata()?.len();
    let mut chunk = vec![0u8; CHUNK];
    let mut end = 0;
    for (index, entry) in entries.iter().enumerate() {
        if entry.offset != end || entry.end > length || !is_intact(&mut file, entry, &mut chunk)? {
            return Ok(index);
        }
        end = entry.end;
    }
    Ok(entries.len())
}

fn is_intact(file: &mut &File, entry: &EntryRecord, chunk: &mut [u8]) -> io::Result<bool> {
    let expected = headers::local_header(entry, Zip64::default());
    let front = expected.len() as u64;
    if entry.offset.checked_add(front).and_then(|at| at.checked_add(entry.compressed))
        != Some(entry.end)
    {
        return Ok(false);
    }
    let mut found = vec![0; expected.len()];
    file.seek(SeekFrom::Start(entry.offset))?;
    file.read_exact(&mut found)?;
    if found != expected {
        return Ok(false);
    }
    let mut body = file.take(entry.compressed);
    let mut crc = crc32fast::Hasher::new();
    loop {
        match body.read(chunk) {
            Ok(0) => break,
            Ok(n) => crc.update(&chunk[..n]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(body.limit() == 0 && crc.finalize() == entry.stored_crc32)
}
