//! A cheap fingerprint of an input file.
//!
//! The identity is `<size>:<BLAKE3, 64 hex digits>`. The hash covers the size and a *sample* of the
//! content: the first and the last 64 KiB and seven blocks of 4 KiB at the eighths in between, so
//! that a recording of any length costs nine short reads. Files up to [`WHOLE`] bytes are hashed
//! whole. An edit that keeps the size and touches none of the sampled blocks goes unseen.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

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
