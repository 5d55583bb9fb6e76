//! Which bytes of a file are samples.

use super::format::{Endian, Format};
use crate::error::AudioError;
use crate::input::Input;
use crate::report::Repair;

/// Behind samples of no length more chunks are not looked at.
const MAX_CHUNKS: usize = 4096;

/// The bytes of the samples.
#[derive(Debug)]
pub(crate) struct Extent {
    /// The first of them.
    pub(crate) start: u64,
    /// How many, whole frames or not; `None`: to the end of a pipe.
    pub(crate) len: Option<u64>,
    /// How many the header declares, where it does.
    pub(crate) declared: Option<u64>,
}

impl Extent {
    /// Samples from the position of `input` on: as many bytes as declared, or to the end. Notes where
    /// the file ends before.
    pub(super) fn new(
        input: &Input,
        format: &Format,
        declared: Option<u64>,
        repairs: &mut Vec<Repair>,
    ) -> Self {
        let start = input.position();
        let available = input.len().map(|len| len.saturating_sub(start));
        let len = match (declared, available) {
            (Some(declared), Some(there)) if declared > there => {
                let (declared, actual) =
                    (Some(format.frames_in(declared)), format.frames_in(there));
                repairs.push(Repair::Truncated { declared, actual });
                Some(there)
            }
            (Some(declared), _) => Some(declared),
            (None, there) => there,
        };
        Self { start, len, declared }
    }
}

/// Notes that the header does not say where the samples end.
pub(super) fn to_end(repair: Repair, repairs: &mut Vec<Repair>) -> Option<u64> {
    repairs.push(repair);
    None
}

/// How chunks say their size.
#[derive(Clone, Copy)]
pub(super) enum Sizes {
    /// In 32 bits; chunks fill whole pairs of bytes.
    Short(Endian),
    /// In 64 bits, as CAF.
    Long,
}

impl Sizes {
    /// The name, the size, and the bytes of both, if a chunk begins here.
    fn read(self, shown: &[u8]) -> Option<(&[u8; 4], u64, u64)> {
        let (name, rest) = shown.split_first_chunk::<4>()?;
        Some(match self {
            Self::Short(endian) => (name, u64::from(endian.u32(*rest.first_chunk()?)), 8),
            Self::Long => (name, u64::from_be_bytes(*rest.first_chunk()?), 12),
        })
    }
}

/// A data size of 0 is meant if nothing follows, or (where the input can be looked through) if
/// chunks follow that end exactly with the file. Otherwise it was never filled in.
pub(super) fn is_really_empty(input: &mut Input, sizes: Sizes) -> Result<bool, AudioError> {
    if input.peek(1)?.is_empty() {
        return Ok(true);
    }
    let (Some(len), start) = (input.len(), input.position()) else {
        return Ok(false);
    };
    let mut chunks = 0;
    let end = loop {
        let at = input.position();
        let shown = input.peek(12)?;
        let Some((name, size, head)) = sizes.read(shown) else { break at };
        let named = name.iter().all(|b| (0x20..0x7f).contains(b));
        let next = match sizes {
            Sizes::Short(_) => (at + head).saturating_add(size + size % 2),
            Sizes::Long => (at + head).saturating_add(size),
        };
        chunks += 1;
        if !named || next > len + 1 || chunks > MAX_CHUNKS {
            break 0;
        }
        input.seek(next.min(len))?;
    };
    input.seek(start)?;
    Ok(end == len)
}

/// Whether a data size is the one that a writer puts where it cannot know: `all`, perhaps rounded
/// down to whole frames, and more than is there.
pub(super) fn is_placeholder(input: &Input, format: &Format, size: u64, all: u64) -> bool {
    let whole = all - all % format.unit_bytes().max(1);
    let available = input.len().map(|len| len.saturating_sub(input.position()));
    (size == all || size == whole) && available.is_none_or(|there| there < size)
}

/// As [`is_placeholder`], where `all` is no whole number of frames, so that no recording has it.
pub(super) fn is_no_size(input: &Input, format: &Format, size: u64, all: u64) -> bool {
    let is_whole = all.is_multiple_of(format.unit_bytes().max(1));
    size == all && !is_whole && is_placeholder(input, format, size, all)
}

/// A chunk before the samples at byte `at` that claims more bytes than the file has.
pub(super) fn beyond_end(at: u64, name: &[u8], size: u64) -> AudioError {
    let name = name.escape_ascii();
    let actual = format!("chunk \"{name}\" of {size} bytes reaches beyond the end of the file");
    AudioError::corrupt(at, actual, "whole chunks before the data")
}
