//! Sony's Wave64: WAV with chunk names of 16 and sizes of 8 bytes.

use super::extent::{Extent, beyond_end, to_end};
use super::format::{Endian, Format};
use super::header::Header;
use crate::error::AudioError;
use crate::input::Input;
use crate::report::Repair;

/// A file with more chunks before its samples is hostile.
const MAX_CHUNKS: usize = 4096;
/// Bytes of a chunk's name and size, which the size counts.
const HEAD: u64 = 24;
const RIFF: [u8; 16] = *b"riff\x2e\x91\xcf\x11\xa5\xd6\x28\xdb\x04\xc1\x00\x00";
/// What the names of the other chunks have in common.
const REST: [u8; 12] = *b"\xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a";

pub(super) fn is_wave64(start: &[u8]) -> bool {
    start.starts_with(&RIFF)
}

/// Reads up to the first sample.
pub(super) fn read(input: &mut Input) -> Result<Header, AudioError> {
    let start = input.position();
    let cut = |at| AudioError::corrupt(at, "the file ends without samples", "chunks fmt and data");
    if !input.skip(HEAD + 16)? {
        return Err(cut(start));
    }
    let mut format = None;
    for _ in 0..MAX_CHUNKS {
        let at = input.position();
        let shown = input.peek(HEAD as usize + 40)?;
        let Some(size) = shown.get(16..24).and_then(<[u8]>::first_chunk) else { break };
        let size = u64::from_le_bytes(*size);
        let name = shown.first_chunk::<4>().filter(|_| shown[4..16] == REST);
        match name {
            Some(b"fmt ") => {
                let end = usize::try_from(size).unwrap_or(usize::MAX).min(shown.len());
                let body = shown.get(HEAD as usize..end).unwrap_or(&[]);
                format = Some(Format::parse(body, Endian::Little, at + HEAD)?);
            }
            Some(b"data") => {
                let Some(format) = format else {
                    return Err(AudioError::corrupt(at, "data before fmt", "a fmt chunk first"));
                };
                input.consume(HEAD as usize);
                return finish(input, format, size);
            }
            _ => {}
        }
        // Chunks begin at multiples of 8.
        let padded = size.max(HEAD).checked_next_multiple_of(8).unwrap_or(u64::MAX);
        let name = name.copied().unwrap_or(*b"????");
        if !input.skip(padded)? {
            return Err(beyond_end(at, &name, size));
        }
    }
    Err(cut(input.position()))
}

fn finish(input: &mut Input, format: Format, size: u64) -> Result<Header, AudioError> {
    let mut repairs: Vec<_> = format.repair.into_iter().collect();
    let declared = match size.saturating_sub(HEAD) {
        _ if size >= i64::MAX as u64 => to_end(Repair::DataSizeUnknown, &mut repairs),
        0 if !input.peek(1)?.is_empty() => to_end(Repair::DataSizeZero, &mut repairs),
        declared => Some(declared),
    };
    let extent = Extent::new(input, &format, declared, &mut repairs);
    Ok(Header { container: "w64", format, endian: Endian::Little, extent, repairs })
}
