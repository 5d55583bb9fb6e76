//! Hashes in a file of ours: damage that the format cannot notice is refused where it is read.
//!
//! The metadata hold a hash of each megabyte of the columns (`corsmal.blocks`), and one of all that
//! follows the last whole megabyte (`corsmal.hash`): the rest of the columns and the metadata
//! themselves, with zeros in its own place.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use bytes::Bytes;
use parquet::errors::ParquetError;
use parquet::file::metadata::{FileMetaData, KeyValue};
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::writer::SerializedFileWriter;

use super::error::Damage;
use super::keys::{BLOCKS, HASH, META, WRITER};

/// Bytes that share a hash.
const BLOCK: u64 = 1 << 20;
/// Hexadecimal digits of the hash of a block.
const DIGITS: usize = 16;
/// Those of the hash of the rest.
const HASH_DIGITS: usize = 64;
/// Bytes that are read at a time.
const PIECE: u64 = 1 << 13;

/// Writes, and hashes what it writes.
pub(super) struct SealingWriter {
    out: BufWriter<File>,
    blocks: String,
    /// What follows the last block that was hashed.
    rest: Vec<u8>,
    /// Whether the rest takes all that is still to come.
    last: bool,
}

impl SealingWriter {
    pub fn new(file: File) -> Self {
        let out = BufWriter::with_capacity(BLOCK as usize, file);
        Self { out, blocks: String::new(), rest: Vec::new(), last: false }
    }
}

impl Write for SealingWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.rest.extend_from_slice(&bytes[..written]);
        if !self.last {
            let blocks = self.rest.chunks_exact(BLOCK as usize);
            let open = blocks.remainder().len();
            blocks.for_each(|block| self.blocks.push_str(&digits(block)));
            self.rest.drain(..self.rest.len() - open);
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Completes a file with the hashes of what it holds.
pub(super) fn finish(mut writer: SerializedFileWriter<SealingWriter>) -> Result<(), ParquetError> {
    writer.flush()?;
    let sealing = writer.inner_mut();
    sealing.last = true;
    let blocks = sealing.blocks.clone();
    for (key, value) in [(BLOCKS, blocks), (HASH, "0".repeat(HASH_DIGITS))] {
        writer.append_key_value_metadata(KeyValue::new(key.into(), value));
    }
    let sealing = writer.into_inner()?;
    let place = place_of_hash(&sealing.rest)
        .ok_or_else(|| ParquetError::General("metadata without a place for their hash".into()))?;
    let hash = blake3::hash(&sealing.rest).to_hex();
    let blocks = (sealing.blocks.len() / DIGITS) as u64;
    let mut file = sealing.out.into_inner().map_err(io::Error::from)?;
    file.seek(SeekFrom::Start(blocks * BLOCK + place as u64))?;
    Ok(file.write_all(hash.as_bytes())?)
}

fn digits(block: &[u8]) -> String {
    blake3::hash(block).to_hex()[..DIGITS].to_owned()
}

/// Where metadata have the digits of their hash: the last value of that key, whose length is one byte.
fn place_of_hash(metadata: &[u8]) -> Option<usize> {
    // The header of the second field of a pair, which is bytes, and their number.
    let mark = [HASH.as_bytes(), &[0x18, HASH_DIGITS as u8]].concat();
    let place = metadata.windows(mark.len()).rposition(|at| at == mark)? + mark.len();
    (place + HASH_DIGITS <= metadata.len()).then_some(place)
}

/// A file of which nothing is handed on that does not match its hashes, if it has any.
#[derive(Clone)]
pub(super) struct SealedFile {
    file: Arc<Mutex<File>>,
    length: u64,
    blocks: Arc<OnceLock<Blocks>>,
}

struct Blocks {
    digits: String,
    /// Those that match.
    sound: Vec<AtomicBool>,
}

impl SealedFile {
    pub fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file: Arc::new(Mutex::new(file)), length, blocks: Arc::default() })
    }

    /// Reads the hashes from the metadata, whose bytes `footer` begin at `start`, and checks that of the
    /// rest. Files of other tools, and those of version 0.1.0, have none.
    pub fn check(
        &self,
        (start, footer): (u64, &[u8]),
        metadata: &FileMetaData,
    ) -> Result<(), ParquetError> {
        // Other tools keep our metadata when they write a table again.
        if !metadata.created_by().is_some_and(|name| name.starts_with(WRITER)) {
            return Ok(());
        }
        let find = |key: &str| {
            let pairs = metadata.key_value_metadata().into_iter().flatten();
            pairs.filter(|pair| pair.key == key).find_map(|pair| pair.value.as_deref())
        };
        let (blocks, hash) = match (find(BLOCKS), find(HASH)) {
            (None, None) if find(META).is_some() => return Ok(()),
            (None, None) => return Err(damaged("its metadata are missing")),
            (Some(blocks), Some(hash)) => (blocks, hash),
            _ => return Err(damaged("one of its two hashes is missing")),
        };
        let count = blocks.len() / DIGITS;
        let rest = count as u64 * BLOCK;
        let place = place_of_hash(footer).map(|place| start + place as u64);
        let are_digits =
            blocks.len() == count * DIGITS && blocks.bytes().all(|digit| digit.is_ascii_hexdigit());
        let place = place.filter(|place| *place >= rest && are_digits);
        let place = place.ok_or_else(|| damaged("its hashes are misplaced"))?;
        if self.hash_of_rest(rest, place)? != hash {
            return Err(damaged("its metadata do not match their hash"));
        }
        let sound = (0..count).map(|_| AtomicBool::new(false)).collect();
        // It is set once, when the file is opened.
        let _ = self.blocks.set(Blocks { digits: blocks.to_owned(), sound });
        Ok(())
    }

    /// Checks all that was not read so far.
    pub fn check_all(&self) -> Result<(), ParquetError> {
        match self.blocks.get() {
            Some(blocks) => self.check_blocks(0, blocks.sound.len() as u64 * BLOCK),
            None => Ok(()),
        }
    }

    fn hash_of_rest(&self, start: u64, place: u64) -> Result<String, ParquetError> {
        let mut hasher = blake3::Hasher::new();
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(start))?;
        hasher.update_reader(Read::by_ref(&mut *file).take(place - start))?;
        hasher.update(&[b'0'; HASH_DIGITS]);
        file.seek(SeekFrom::Start(place + HASH_DIGITS as u64))?;
        hasher.update_reader(&mut *file)?;
        Ok(hasher.finalize().to_hex().to_string())
    }

    /// Checks the blocks that these bytes touch.
    fn check_blocks(&self, start: u64, length: u64) -> Result<(), ParquetError> {
        let Some(blocks) = self.blocks.get().filter(|_| length > 0) else { return Ok(()) };
        let last = (start.saturating_add(length) - 1) / BLOCK;
        for i in start / BLOCK..=last {
            let Some(sound) = blocks.sound.get(i as usize) else { break };
            if sound.load(Ordering::Relaxed) {
                continue;
            }
            let block = self.read(i * BLOCK, BLOCK as usize)?;
            if digits(&block) != blocks.digits[i as usize * DIGITS..][..DIGITS] {
                let (from, to) = (i * BLOCK, (i + 1) * BLOCK);
                return Err(damaged(format!("bytes {from} to {to} do not match their hash")));
            }
            sound.store(true, Ordering::Relaxed);
        }
        Ok(())
    }

    fn read(&self, start: u64, length: usize) -> Result<Vec<u8>, ParquetError> {
        if start.checked_add(length as u64).is_none_or(|end| end > self.length) {
            let what = format!("{length} bytes at {start} of a file of {}", self.length);
            return Err(ParquetError::EOF(what));
        }
        let mut bytes = vec![0; length];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

fn damaged(how: impl Into<String>) -> ParquetError {
    ParquetError::External(Box::new(Damage(how.into())))
}

impl Length for SealedFile {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for SealedFile {
    type T = io::BufReader<SealedRead>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        let read = SealedRead { file: self.clone(), at: start };
        Ok(io::BufReader::with_capacity(PIECE as usize, read))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        self.check_blocks(start, length as u64)?;
        Ok(self.read(start, length)?.into())
    }
}

/// Reads on from a place.
pub(super) struct SealedRead {
    file: SealedFile,
    at: u64,
}

impl Read for SealedRead {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = self.file.length.saturating_sub(self.at).min(PIECE);
        let count = out.len().min(left as usize);
        let bytes = self.file.get_bytes(self.at, count).map_err(|e| match e {
            ParquetError::External(inner) => io::Error::other(inner),
            other => io::Error::other(other),
        })?;
        out[..count].copy_from_slice(&bytes);
        self.at += count as u64;
        Ok(count)
    }
}

/// Makes a file one as of version 0.1.0, by names that nobody looks for.
#[cfg(test)]
pub(super) fn without(keys: &[&str], bytes: &mut [u8]) {
    for key in keys {
        let places: Vec<_> = (0..bytes.len() - key.len())
            .filter(|&at| bytes[at..].starts_with(key.as_bytes()))
            .collect();
        places.into_iter().for_each(|at| bytes[at] = b'C');
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use ndarray::ArrayD;

    use super::*;
    use crate::outcome::{Outcome, Status};
    use crate::parquet::{Frames, FramesWriter, ParquetFile, write};
    use crate::provenance::Provenance;
    use crate::shard::Shard;
    use crate::table::Table;

    fn table(rows: usize, width: usize) -> Table {
        let mut table = Table::new(vec!["room".into()]).unwrap();
        let names: Vec<String> = (0..width).map(|i| format!("mean[{i}]")).collect();
        table.name_features(&names).unwrap();
        for row in 0..rows {
            let values: Vec<f32> = (0..width).map(|i| ((row * 31 + i) as f32).sin()).collect();
            let outcome = Outcome::new(format!("r/{row}"), "x.wav", Status::Ok, "");
            table.push(outcome, &[("room".into(), format!("{}", row % 3))], &values).unwrap();
        }
        table
    }

    fn provenance() -> Provenance {
        let config = r#"{"features": {"mfcc": {}}}"#;
        Provenance::new(config.into(), "c0ffee".into(), "beef".into(), Shard::default())
    }

    /// Frames of `rows` recordings, 3 MB each that do not compress.
    fn write_frames(path: &Path, rows: usize) {
        let file = File::options().create(true).read(true).write(true).truncate(true).open(path);
        let table = table(rows, 0);
        let mut writer = FramesWriter::over(file.unwrap(), path, &table, &provenance()).unwrap();
        for row in 0..rows {
            let noise = |i: usize| {
                let mut mixed = ((row * 800_000 + i) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                mixed = (mixed ^ mixed >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                (mixed >> 40) as f32
            };
            let values = (0..40 * 20_000).map(noise).collect();
            let values = ArrayD::from_shape_vec(vec![2, 20, 20_000], values).unwrap();
            let times = (0..20_000).map(|t| t as f64 * 0.1).collect();
            writer.push(vec![Frames { values, times }]).unwrap();
        }
        writer.finish().unwrap();
    }

    fn flip(path: &Path, at: usize, to: &Path) {
        let mut bytes = std::fs::read(path).unwrap();
        bytes[at] ^= 1 << (at % 8);
        std::fs::write(to, bytes).unwrap();
    }

    #[test]
    fn no_flipped_bit_gives_another_table() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("a.parquet"), folder.path().join("b.parquet"));
        let table = table(5, 3);
        write(&path, &table, &provenance()).unwrap();
        let length = std::fs::read(&path).unwrap().len();
        let mut refused = 0;
        for at in 0..length {
            flip(&path, at, &other);
            let read = ParquetFile::open(&other).and_then(|file| file.table());
            match read {
                Ok((found, of)) => assert!((found, of) == (table.clone(), provenance()), "{at}"),
                Err(_) => refused += 1,
            }
        }
        // Less than the name of the program that wrote it, and what nobody reads.
        assert!(refused > length - 32, "{refused} of {length}");
    }

    #[test]
    fn damage_is_refused_where_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("a.parquet"), folder.path().join("b.parquet"));
        write_frames(&path, 2);
        let length = std::fs::read(&path).unwrap().len();
        assert!(length as u64 > 4 * BLOCK, "{length}");
        let rows = |path: &Path| -> [Result<Frames, String>; 2] {
            let mut file = ParquetFile::open(path).unwrap();
            [0, 1].map(|row| file.frames(row, "mfcc").map_err(|e| e.to_string()))
        };
        let whole = rows(&path);
        assert!(whole.iter().all(Result::is_ok));
        ParquetFile::open(&path).unwrap().check().unwrap();
        let mut refused = [0, 0];
        for at in (2_000..length - 60_000).step_by(length / 23) {
            flip(&path, at, &other);
            match ParquetFile::open(&other) {
                Ok(file) => assert!(file.check().is_err(), "{at}"),
                Err(_) => continue,
            }
            for (row, (found, expected)) in rows(&other).iter().zip(&whole).enumerate() {
                match found {
                    Ok(found) => assert!(Ok(found) == expected.as_ref(), "row {row}: {at}"),
                    Err(why) => refused[row] += usize::from(why.contains("match their hash")),
                }
            }
        }
        assert!(refused.iter().all(|&count| count >= 8), "{refused:?}");
    }

    #[test]
    fn files_without_hashes_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let table = table(5, 3);
        write(&path, &table, &provenance()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let renamed = |names: &[&str]| {
            let mut bytes = whole.clone();
            without(names, &mut bytes);
            std::fs::write(&path, bytes).unwrap();
            ParquetFile::open(&path)
        };
        // As files of version 0.1.0.
        assert_eq!(renamed(&[BLOCKS, HASH]).unwrap().table().unwrap().0, table);
        // As those of tools that keep the metadata of what they read: no longer an output of ours.
        let other = renamed(&["corsmal-feat"]).unwrap();
        assert!(!other.is_ours());
        assert_eq!(other.numbers().unwrap().values, table.values().mapv(f64::from));
        for one in [BLOCKS, HASH] {
            let why = renamed(&[one]).unwrap_err().to_string();
            assert!(why.contains("the file is damaged"), "{why}");
        }
    }
}
