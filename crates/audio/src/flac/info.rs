//! The stream information of FLAC, and the other metadata blocks, which are passed over.

use super::frame::{Header, MAX_HEADER};
use crate::error::AudioError;
use crate::input::Input;

const MAGIC: &[u8] = b"fLaC";
/// Bytes of the block.
const LENGTH: usize = 34;
const STREAM_INFO: u8 = 0;
const FORBIDDEN: u8 = 127;
/// Largest block that a frame header can state.
const MAX_BLOCK: u32 = 65_536;
/// Files with more metadata blocks are hostile.
const MAX_BLOCKS: usize = 4096;

/// What the whole recording has in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Info {
    /// Samples per channel of a frame, where frames are equal.
    pub(super) block: u32,
    pub(super) sample_rate: u32,
    pub(super) channels: u16,
    pub(super) bits: u32,
    /// Samples per channel, where stated.
    pub(super) declared: Option<u64>,
}

impl Info {
    /// ```text
    /// 0  u16 smallest block    4  u24 smallest frame   10  20 bits Hz, 3 channels - 1,
    /// 2  u16 largest block     7  u24 largest frame        5 bits per sample - 1, 36 samples
    /// ```
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let block = u32::from(u16::from_be_bytes([*body.get(2)?, *body.get(3)?]));
        let packed = u64::from_be_bytes(*body.get(10..)?.first_chunk()?);
        let declared = packed & ((1 << 36) - 1);
        Some(Self {
            block,
            sample_rate: (packed >> 44) as u32,
            channels: (packed >> 41 & 7) as u16 + 1,
            bits: (packed >> 36 & 31) as u32 + 1,
            declared: (declared > 0).then_some(declared),
        })
        .filter(|info| (1..=655_350).contains(&info.sample_rate) && info.bits >= 4)
    }

    /// A block with the same meaning and without what readers refuse: bounds that are not kept.
    pub(super) fn repaired(&self) -> [u8; LENGTH] {
        let mut body = [0; LENGTH];
        body[..4].copy_from_slice(&[0, 16, 0xff, 0xff]);
        let packed = u64::from(self.sample_rate) << 44
            | u64::from(self.channels - 1) << 41
            | u64::from(self.bits - 1) << 36;
        body[10..18].copy_from_slice(&packed.to_be_bytes());
        body
    }

    /// Most bytes of a frame: samples stored as they are, one bit more for a difference.
    pub(super) fn max_frame(&self, block: u32) -> usize {
        let block = block.clamp(16, MAX_BLOCK) as usize;
        let samples = block * usize::from(self.channels);
        samples * (self.bits as usize + 1) / 8 + 16 * usize::from(self.channels) + MAX_HEADER + 2
    }

    /// Whether a frame of this recording can have this header.
    pub(super) fn admits(&self, header: &Header) -> bool {
        header.channels == self.channels
            && header.bits.is_none_or(|bits| bits == self.bits)
            && header.sample_rate.is_none_or(|rate| rate == self.sample_rate)
    }
}

/// Bytes that [`continues`] and a frame header look at.
pub(super) const SHOWN: usize = if MAX_HEADER > 8 { MAX_HEADER } else { 8 };

/// Whether the magic number is here.
pub(super) fn starts(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Whether another stream starts here, after the frames of one.
pub(super) fn continues(bytes: &[u8]) -> bool {
    matches!(bytes, [b'f', b'L', b'a', b'C', 0 | 0x80, 0, 0, n, ..] if usize::from(*n) == LENGTH)
}

/// Reads the metadata, from the magic number to the first frame. Only the stream information
/// matters; other blocks may hold anything.
pub(super) fn read(input: &mut Input) -> Result<Info, AudioError> {
    let start = input.position();
    input.peek(MAGIC.len())?;
    input.consume(MAGIC.len());
    let mut info = None;
    for _ in 0..MAX_BLOCKS {
        let shown = input.peek(4 + LENGTH)?;
        let Some(&[kind, a, b, c]) = shown.first_chunk::<4>() else { break };
        let length = u32::from_be_bytes([0, a, b, c]);
        let (is_last, kind) = (kind & 0x80 != 0, kind & 0x7f);
        if kind == FORBIDDEN || (kind == STREAM_INFO && info.is_some()) {
            // A frame, or damage: the frames are found by their own marks.
            break;
        }
        if kind == STREAM_INFO {
            info = shown.get(4..4 + LENGTH).and_then(Info::parse);
        }
        input.consume(4);
        if !input.pass(length.into())? || is_last {
            break;
        }
    }
    info.ok_or_else(|| {
        AudioError::corrupt(start, "FLAC without usable stream information", "a STREAMINFO block")
    })
}
