//! AIFF and AIFF-C (Apple, 1989 and 1991).

use super::extent::{Extent, Sizes, beyond_end, is_placeholder, is_really_empty, to_end};
use super::format::{Encoding, Endian, Format};
use super::header::Header;
use crate::error::AudioError;
use crate::input::Input;
use crate::report::Repair;

/// A file with more chunks before its samples is hostile.
const MAX_CHUNKS: usize = 4096;
/// The size of samples that SoX states where it writes into a pipe.
const STREAMED: u64 = 0x7f00_0000;
const EXPECTED: &str = "AIFF: PCM of 1 to 32 bits, float of 32 or 64 bits, A-law, mu-law";

/// What the `COMM` chunk says.
struct Common {
    format: Format,
    endian: Endian,
}

pub(super) fn is_aiff(start: &[u8]) -> bool {
    start.starts_with(b"FORM") && matches!(start.get(8..12), Some(b"AIFF" | b"AIFC"))
}

/// Reads up to the first sample. The samples may come before what describes them, where the input can
/// be looked through.
pub(super) fn read(input: &mut Input) -> Result<Header, AudioError> {
    let start = input.position();
    let is_compressed = input.peek(12)?.get(8..12) == Some(b"AIFC");
    input.consume(12);
    let mut common = None;
    let mut sound = None;
    for _ in 0..MAX_CHUNKS {
        let at = input.position();
        let Some(&[i0, i1, i2, i3, s0, s1, s2, s3]) = input.peek(8)?.first_chunk::<8>() else {
            break;
        };
        let (id, size) = ([i0, i1, i2, i3], u32::from_be_bytes([s0, s1, s2, s3]));
        match &id {
            b"COMM" => common = Some(Common::parse(input.peek(8 + 22)?, is_compressed, at)?),
            b"SSND" => sound = Some((at, size)),
            _ => {}
        }
        if common.is_some() && sound.is_some() {
            break;
        }
        input.consume(8);
        let padded = u64::from(size) + u64::from(size % 2);
        if sound.is_some() && input.len().is_none() {
            return Err(AudioError::corrupt(at, "SSND before COMM in a stream", "COMM first"));
        }
        if !input.skip(padded)? {
            return Err(beyond_end(at, &id, size.into()));
        }
    }
    let (Some(Common { format, endian }), Some((at, size))) = (common, sound) else {
        let actual = "no COMM and SSND chunk";
        return Err(AudioError::corrupt(start, actual, "both chunks of AIFF"));
    };
    if input.position() != at {
        input.seek(at)?;
    }
    let offset = match input.peek(16)?.first_chunk::<16>() {
        Some(&[.., a, b, c, d, _, _, _, _]) => u32::from_be_bytes([a, b, c, d]),
        None => return Err(AudioError::corrupt(at, "an SSND chunk cut off", "16 bytes")),
    };
    input.consume(16);
    if !input.skip(offset.into())? {
        let actual = format!("samples {offset} bytes after their chunk");
        return Err(AudioError::corrupt(at, actual, "samples inside the file"));
    }
    let mut repairs = Vec::new();
    let declared = match u64::from(size).saturating_sub(8 + u64::from(offset)) {
        _ if size == u32::MAX => to_end(Repair::DataSizeUnknown, &mut repairs),
        size if is_placeholder(input, &format, size, STREAMED) => {
            to_end(Repair::DataSizeUnknown, &mut repairs)
        }
        // The count of frames in COMM is filled in as late as this size.
        0 if !is_really_empty(input, Sizes::Short(Endian::Big))? => {
            to_end(Repair::DataSizeZero, &mut repairs)
        }
        declared => Some(declared),
    };
    let extent = Extent::new(input, &format, declared, &mut repairs);
    let container = if is_compressed { "aifc" } else { "aiff" };
    Ok(Header { container, format, endian, extent, repairs })
}

impl Common {
    /// ```text
    /// 8  u16 channels  10 u32 frames  14 u16 bits  16 rate as an 80-bit float  26 compression
    /// ```
    fn parse(chunk: &[u8], is_compressed: bool, at: u64) -> Result<Self, AudioError> {
        let cut = || AudioError::corrupt(at, "a COMM chunk cut off", "18 bytes, 22 in AIFF-C");
        let body = chunk.get(8..26).ok_or_else(cut)?;
        let u16_at = |i: usize| u16::from_be_bytes([body[i], body[i + 1]]);
        let channels = u16_at(0);
        let bits = u16_at(6);
        let bytes = u8::try_from(bits.div_ceil(8)).unwrap_or(u8::MAX);
        let kind = if is_compressed { chunk.get(26..30).ok_or_else(cut)? } else { b"NONE" };
        let (encoding, endian) = match kind {
            b"NONE" | b"twos" if (1..=4).contains(&bytes) => (Encoding::Int(bytes), Endian::Big),
            b"sowt" if (1..=4).contains(&bytes) => (Encoding::Int(bytes), Endian::Little),
            b"in24" => (Encoding::Int(3), Endian::Big),
            b"in32" => (Encoding::Int(4), Endian::Big),
            // libsndfile writes a digit.
            b"42ni" | b"42n1" => (Encoding::Int(3), Endian::Little),
            b"23ni" => (Encoding::Int(4), Endian::Little),
            b"raw " => (Encoding::U8, Endian::Big),
            b"fl32" | b"FL32" => (Encoding::F32, Endian::Big),
            b"fl64" | b"FL64" => (Encoding::F64, Endian::Big),
            b"alaw" | b"ALAW" => (Encoding::ALaw, Endian::Big),
            b"ulaw" | b"ULAW" => (Encoding::MuLaw, Endian::Big),
            kind => {
                let actual = format!("AIFF with \"{}\" of {bits} bits", kind.escape_ascii());
                return Err(AudioError::unsupported(at, actual, EXPECTED));
            }
        };
        let format = Format::new(channels.into(), extended(&body[8..18]), encoding, at)?;
        Ok(Self { format, endian })
    }
}

/// An IEEE float of 80 bits: sign and exponent in 16, then the whole mantissa.
fn extended(bytes: &[u8]) -> f64 {
    let exponent = i32::from(u16::from_be_bytes([bytes[0] & 0x7f, bytes[1]])) - 16_383 - 63;
    let mantissa = bytes[2..10].iter().fold(0u64, |n, b| n << 8 | u64::from(*b));
    mantissa as f64 * f64::from(exponent.clamp(-1100, 1000)).exp2()
}

#[cfg(test)]
mod tests {
    #[test]
    fn rates_are_floats_of_80_bits() {
        assert_eq!(super::extended(&[0x40, 0x0e, 0xac, 0x44, 0, 0, 0, 0, 0, 0]), 44_100.0);
        assert_eq!(super::extended(&[0x3f, 0xff, 0x80, 0, 0, 0, 0, 0, 0, 0]), 1.0);
    }
}
