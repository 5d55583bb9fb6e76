//! Frame headers of FLAC (RFC 9639, section 9.1).

use symphonia::core::checksum::{Crc8Ccitt, Crc16Ansi};
use symphonia::core::io::Monitor;

/// Longest frame header.
pub(super) const MAX_HEADER: usize = 16;

/// What a frame header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    /// Samples per channel.
    pub(super) block: u32,
    pub(super) number: Number,
    pub(super) channels: u16,
    /// Whether one of two channels is the difference of both.
    pub(super) has_side: bool,
    /// Bits per sample, where the header says so itself.
    pub(super) bits: Option<u32>,
    /// Hz, where the header says so itself.
    pub(super) sample_rate: Option<u32>,
}

/// Where the frame is in the recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    /// Counted in frames of equal size.
    Frame(u64),
    /// Counted in samples.
    Sample(u64),
}

/// Whether the mark of a frame is here, which may be chance.
pub(super) fn may_start(bytes: &[u8]) -> bool {
    matches!(bytes, [0xff, 0xf8 | 0xf9, ..])
}

/// The first header of a frame, of those that are admitted.
pub(super) fn first(bytes: &[u8], admits: impl Fn(&Header) -> bool) -> Option<Header> {
    let starts = (0..bytes.len()).filter(|&at| may_start(&bytes[at..]));
    starts.filter_map(|at| Header::parse(&bytes[at..])).find(admits)
}

/// The header of the frame that ends with these bytes, by its checksums.
pub(super) fn last(bytes: &[u8]) -> Option<Header> {
    let starts = (0..bytes.len()).rev().filter(|&at| may_start(&bytes[at..]));
    starts.filter_map(|at| Some((at, Header::parse(&bytes[at..])?))).find_map(|(at, header)| {
        let mut crc = Crc16Ansi::new(0);
        crc.process_buf_bytes(&bytes[at..]);
        (crc.crc() == 0).then_some(header)
    })
}

impl Header {
    /// Reads a header with a right checksum from the start of `bytes`.
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let &[0xff, sync @ (0xf8 | 0xf9), sizes, layout, ..] = bytes else {
            return None;
        };
        let mut rest = bytes.get(4..)?;
        let mut take = |n: usize| {
            let (head, tail) = rest.split_at_checked(n)?;
            rest = tail;
            Some(head.iter().fold(0u64, |v, b| v << 8 | u64::from(*b)))
        };
        // The number is stored like a character in UTF-8, of up to seven bytes.
        let lead = take(1)? as u8;
        let more = match lead.leading_ones() {
            0 => 0,
            n @ 2..=7 => n - 1,
            _ => return None,
        };
        let mut number = if more == 0 { u64::from(lead) } else { u64::from(lead) & (0x3f >> more) };
        for _ in 0..more {
            match take(1)? {
                byte @ 0x80..=0xbf => number = number << 6 | (byte & 0x3f),
                _ => return None,
            }
        }
        let block = match sizes >> 4 {
            0 => return None,
            1 => 192,
            n @ 2..=5 => 576 << (n - 2),
            6 => take(1)? as u32 + 1,
            7 => take(2)? as u32 + 1,
            n => 256 << (n - 8),
        };
        const RATES: [u32; 11] = [
            88_200, 176_400, 192_000, 8000, 16_000, 22_050, 24_000, 32_000, 44_100, 48_000, 96_000,
        ];
        let sample_rate = match sizes & 15 {
            0 => None,
            n @ 1..=11 => Some(RATES[usize::from(n) - 1]),
            12 => Some(take(1)? as u32 * 1000),
            13 => Some(take(2)? as u32),
            14 => Some(take(2)? as u32 * 10),
            _ => return None,
        };
        let (channels, has_side) = match layout >> 4 {
            n @ 0..=7 => (u16::from(n) + 1, false),
            8..=10 => (2, true),
            _ => return None,
        };
        let bits = match layout >> 1 & 7 {
            0 => None,
            3 => return None,
            n => Some([8, 12, 0, 16, 20, 24, 32][usize::from(n) - 1]),
        };
        if layout & 1 != 0 {
            return None;
        }
        let checksum = take(1)? as u8;
        let length = bytes.len() - rest.len();
        let mut crc = Crc8Ccitt::new(0);
        crc.process_buf_bytes(&bytes[..length - 1]);
        let number = if sync == 0xf9 { Number::Sample(number) } else { Number::Frame(number) };
        let header = Self { block, number, channels, has_side, bits, sample_rate };
        (crc.crc() == checksum).then_some(header)
    }
}
