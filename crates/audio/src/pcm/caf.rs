//! Apple's Core Audio Format, version 1.

use super::extent::{Extent, Sizes, beyond_end, is_really_empty, to_end};
use super::format::{Encoding, Endian, Format};
use super::header::Header;
use crate::error::AudioError;
use crate::input::Input;
use crate::report::Repair;

/// A file with more chunks before its samples is hostile.
const MAX_CHUNKS: usize = 4096;
const EXPECTED: &str = "CAF: PCM of 8 to 64 bits, float of 32 or 64 bits, A-law, mu-law";

pub(super) fn is_caf(start: &[u8]) -> bool {
    start.starts_with(b"caff\0\x01")
}

/// Reads up to the first sample.
pub(super) fn read(input: &mut Input) -> Result<Header, AudioError> {
    input.skip(8)?;
    let mut description = None;
    for _ in 0..MAX_CHUNKS {
        let at = input.position();
        let shown = input.peek(12 + 32)?;
        let Some(size) = shown.get(4..12).and_then(<[u8]>::first_chunk) else { break };
        let size = i64::from_be_bytes(*size);
        let name = [shown[0], shown[1], shown[2], shown[3]];
        match &name {
            b"desc" => description = Some(describe(shown.get(12..44), at)?),
            b"data" => {
                let Some((format, endian)) = description else {
                    return Err(AudioError::corrupt(at, "data before desc", "a desc chunk first"));
                };
                if !input.skip(12)? {
                    break;
                }
                let is_bare = size == 0 && is_really_empty(input, Sizes::Long)?;
                // Four bytes count the edits.
                if !is_bare && !input.skip(4)? {
                    break;
                }
                let mut repairs = Vec::new();
                let declared = match u64::try_from(size) {
                    Ok(0) if is_bare => Some(0),
                    // Minus one says "until the end" by the format itself.
                    Err(_) => None,
                    Ok(0..=4) if !is_really_empty(input, Sizes::Long)? => {
                        to_end(Repair::DataSizeZero, &mut repairs)
                    }
                    Ok(size) => Some(size.saturating_sub(4)),
                };
                let extent = Extent::new(input, &format, declared, &mut repairs);
                return Ok(Header { container: "caf", format, endian, extent, repairs });
            }
            _ => {}
        }
        let size = u64::try_from(size).unwrap_or(u64::MAX);
        if !input.skip(size.saturating_add(12))? {
            return Err(beyond_end(at, &name, size));
        }
    }
    let at = input.position();
    Err(AudioError::corrupt(at, "the file ends without samples", "chunks desc and data"))
}

/// ```text
/// 0  f64 Hz  8  codec  12 u32 flags: 1 float, 2 little-endian  16 u32 bytes of a packet
/// 20 u32 frames of a packet  24 u32 channels  28 u32 bits
/// ```
fn describe(body: Option<&[u8]>, at: u64) -> Result<(Format, Endian), AudioError> {
    let Some(body) = body else {
        return Err(AudioError::corrupt(at, "a desc chunk cut off", "32 bytes"));
    };
    let u32_at = |i: usize| u32::from_be_bytes([body[i], body[i + 1], body[i + 2], body[i + 3]]);
    let rate = body.first_chunk().map_or(0.0, |b| f64::from_be_bytes(*b));
    let (flags, packet, channels, bits) = (u32_at(12), u32_at(16), u32_at(24), u32_at(28));
    let bytes = packet.checked_div(channels).unwrap_or(0);
    let is_tight = bits.div_ceil(8) == bytes && packet == bytes.saturating_mul(channels);
    let encoding = match &body[8..12] {
        b"lpcm" if flags & 1 != 0 && is_tight && bytes == 4 => Encoding::F32,
        b"lpcm" if flags & 1 != 0 && is_tight && bytes == 8 => Encoding::F64,
        b"lpcm" if flags & 1 == 0 && is_tight && (1..=8).contains(&bytes) => {
            Encoding::Int(bytes as u8)
        }
        b"alaw" => Encoding::ALaw,
        b"ulaw" => Encoding::MuLaw,
        codec => {
            let name = codec.escape_ascii();
            let actual = format!("CAF with \"{name}\" of {bits} bits in {packet} bytes");
            return Err(AudioError::unsupported(at, actual, EXPECTED));
        }
    };
    let endian = if flags & 2 != 0 { Endian::Little } else { Endian::Big };
    Ok((Format::new(channels, rate, encoding, at)?, endian))
}
