//! A cheap fingerprint of an input file.
//!
//! The identity is `<size>:<BLAKE3, 64 hex digits>`. The hash covers the size and a *sample* of the
//! content: the first and the last 64 KiB and seven blocks of 4 KiB at the eighths in between, so
//! that a recording of any length costs nine short reads. Files up to [`WHOLE`] bytes are hashed
//! whole. An edit that keeps the size and touches none of the sampled blocks goes unseen.

use std::fs::{File, Metadata};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::{Duration, SystemTime};

/// Identity of standard input, pipes and devices, which cannot be sampled without being consumed.
pub const STREAM: &str = "stream";

/// Files up to this size are hashed whole (256 KiB).
pub const WHOLE: u64 = 4 * EDGE;

const EDGE: u64 = 64 * 1024;
const BLOCK: u64 = 4 * 1024;

/// Computes the identity of a file; [`STREAM`] where it is none.
///
/// # Errors
/// Whatever opening, seeking or reading reports.
pub fn of_file(path: &Path) -> io::Result<String> {
    // Before it is opened: that would wait for whoever writes to a pipe.
    if !std::fs::metadata(path)?.is_file() {
        return Ok(STREAM.into());
    }
    let mut file = File::open(path)?;
    let size = file.metadata()?.len();
    of_reader(&mut file, size)
}

/// As [`of_file`], of bytes in memory.
pub fn of_bytes(bytes: &[u8]) -> String {
    of_reader(&mut io::Cursor::new(bytes), bytes.len() as u64).unwrap_or_default()
}

/// As [`of_file`], of `size` bytes that can be read and seeked in.
///
/// # Errors
/// Whatever seeking or reading reports.
pub fn of_reader(file: &mut (impl Read + Seek), size: u64) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&size.to_le_bytes());
    let mut buffer = Vec::new();
    for (offset, length) in blocks(size) {
        file.seek(SeekFrom::Start(offset))?;
        buffer.clear();
        file.by_ref().take(length).read_to_end(&mut buffer)?;
        hasher.update(&buffer);
    }
    Ok(format!("{size}:{}", hasher.finalize().to_hex()))
}

/// What the file system says of a file. Of equal stamps the later one is of the same file, which
/// nobody has rewritten, made longer or cut in between; except within [`Stamp::is_fresh`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    /// Device and number of the file there; zero where the system has none.
    pub file: (u64, u64),
    /// Length in bytes.
    pub size: u64,
    /// Last change of the content.
    pub modified: Option<SystemTime>,
}

/// Within this time of a change, another one may give the same time stamp.
const CLOCK: Duration = Duration::from_secs(2);
/// A file system's clock is not further ahead of ours.
const SKEW: Duration = Duration::from_hours(24);

impl Stamp {
    /// The stamp of a file; `None` for pipes and devices.
    ///
    /// # Errors
    /// Whatever the system reports.
    pub fn of_path(path: &Path) -> io::Result<Option<Self>> {
        let meta = std::fs::metadata(path)?;
        Ok(meta.is_file().then(|| Self {
            file: number(&meta),
            size: meta.len(),
            modified: meta.modified().ok(),
        }))
    }

    /// Whether the file has changed so lately that a further change might keep the stamp: the clock
    /// of a file system is coarse.
    pub fn is_fresh(&self) -> bool {
        let Some(modified) = self.modified else { return true };
        match modified.elapsed() {
            Ok(age) => age <= CLOCK,
            // The clock of a server may be ahead. What lies further ahead was not written now.
            Err(ahead) => ahead.duration() <= SKEW,
        }
    }
}

#[cfg(unix)]
fn number(meta: &Metadata) -> (u64, u64) {
    use std::os::unix::fs::MetadataExt;
    (meta.dev(), meta.ino())
}

#[cfg(not(unix))]
fn number(_: &Metadata) -> (u64, u64) {
    (0, 0)
}

/// The sampled stretches as (offset, length), in ascending order and without overlap.
fn blocks(size: u64) -> Vec<(u64, u64)> {
    if size <= WHOLE {
        return vec![(0, size)];
    }
    let between = (1..8).map(|eighth| (size / 8 * eighth, BLOCK));
    std::iter::once((0, EDGE))
        .chain(between.filter(|&(at, length)| at >= EDGE && at + length <= size - EDGE))
        .chain(std::iter::once((size - EDGE, EDGE)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn identity(bytes: &[u8]) -> String {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(bytes).unwrap();
        of_file(file.path()).unwrap()
    }

    #[test]
    fn a_stamp_tells_what_happened_to_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let stamp = || Stamp::of_path(&path).unwrap().unwrap();
        std::fs::write(&path, b"one").unwrap();
        let first = stamp();
        assert!(first == stamp() && first.is_fresh());
        let long_ago = SystemTime::now() - Duration::from_secs(60);
        File::options().write(true).open(&path).unwrap().set_modified(long_ago).unwrap();
        let old = stamp();
        assert!(old != first && !old.is_fresh());
        let at = |time| Stamp { modified: Some(time), ..old };
        assert!(at(SystemTime::now() + Duration::from_hours(1)).is_fresh());
        assert!(!at(SystemTime::now() + Duration::from_hours(1000)).is_fresh());
        std::fs::write(&path, b"two").unwrap();
        assert!(stamp().modified != old.modified && stamp().file == old.file);
        std::fs::write(folder.path().join("b"), b"two").unwrap();
        std::fs::rename(folder.path().join("b"), &path).unwrap();
        #[cfg(unix)]
        assert_ne!(stamp().file, old.file);
        assert!(Stamp::of_path(folder.path()).unwrap().is_none(), "no file");
    }

    #[test]
    fn every_byte_of_a_small_file_counts() {
        let bytes = vec![7u8; 1000];
        let plain = identity(&bytes);
        assert!(plain.starts_with("1000:") && plain.len() == 5 + 64, "{plain}");
        for at in [0, 1, 500, 999] {
            let mut changed = bytes.clone();
            changed[at] ^= 1;
            assert_ne!(identity(&changed), plain, "byte {at}");
        }
        assert_ne!(identity(&bytes[..999]), plain);
    }

    #[test]
    fn a_large_file_is_sampled_at_both_ends_and_between() {
        let bytes = vec![0u8; 1 << 20];
        let plain = identity(&bytes);
        for at in [0, 65_535, 131_072, 131_072 + 4095, 7 * 131_072, (1 << 20) - 1] {
            let mut changed = bytes.clone();
            changed[at] = 1;
            assert_ne!(identity(&changed), plain, "byte {at}");
        }
        let mut unseen = bytes;
        unseen[131_072 + 4096] = 1;
        assert_eq!(identity(&unseen), plain, "documented: sampled, not complete");
    }

    #[test]
    fn blocks_never_overlap_or_leave_the_file() {
        for size in (0..2_000_000).step_by(997) {
            let mut end = 0;
            for (at, length) in blocks(size) {
                assert!(at >= end && at + length <= size, "{size}");
                end = at + length;
            }
            assert_eq!(end, size);
        }
    }
}
