//! Sun's AU, also known as SND.

use super::extent::{Extent, to_end};
use super::format::{Encoding, Endian, Format};
use super::header::Header;
use crate::error::AudioError;
use crate::input::Input;
use crate::report::Repair;

const EXPECTED: &str = "AU: PCM of 8 to 32 bits, float of 32 or 64 bits, A-law, mu-law";

pub(super) fn is_au(start: &[u8]) -> bool {
    start.starts_with(b".snd") || start.starts_with(b"dns.")
}

/// Reads up to the first sample.
///
/// ```text
/// 0  ".snd" or "dns.", whose numbers have the other byte order    4  u32 start of the samples
/// 8  u32 bytes of samples or all ones    12 u32 encoding    16 u32 Hz    20 u32 channels
/// ```
pub(super) fn read(input: &mut Input) -> Result<Header, AudioError> {
    let start = input.position();
    let Some(head) = input.peek(24)?.first_chunk::<24>() else {
        return Err(AudioError::corrupt(start, "an AU header cut off", "24 bytes"));
    };
    let endian = if head.starts_with(b"dns.") { Endian::Little } else { Endian::Big };
    let u32_at = |i: usize| endian.u32([head[i], head[i + 1], head[i + 2], head[i + 3]]);
    let (offset, size, encoding) = (u32_at(4), u32_at(8), u32_at(12));
    let (sample_rate, channels) = (u32_at(16), u32_at(20));
    let encoding = match encoding {
        1 => Encoding::MuLaw,
        2..=5 => Encoding::Int(encoding as u8 - 1),
        6 => Encoding::F32,
        7 => Encoding::F64,
        27 => Encoding::ALaw,
        _ => {
            let actual = format!("AU with encoding {encoding}");
            return Err(AudioError::unsupported(start + 12, actual, EXPECTED));
        }
    };
    let format = Format::new(channels, sample_rate.into(), encoding, start + 16)?;
    if offset < 24 || !input.skip(offset.into())? {
        let actual = format!("samples from byte {offset} on");
        return Err(AudioError::corrupt(start + 4, actual, "a place after the header"));
    }
    let mut repairs = Vec::new();
    let declared = match size {
        // All ones say "until the end" by the format itself.
        u32::MAX => None,
        0 if !input.peek(1)?.is_empty() => to_end(Repair::DataSizeZero, &mut repairs),
        size => Some(u64::from(size)),
    };
    let extent = Extent::new(input, &format, declared, &mut repairs);
    Ok(Header { container: "au", format, endian, extent, repairs })
}
