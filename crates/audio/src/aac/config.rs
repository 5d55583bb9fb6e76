//! What a decoder must know of a stream of AAC: the AudioSpecificConfig (ISO 14496-3, 1.6.2.1).

use super::bits::Bits;
use crate::codec::{Codec, Refusal};

const SAMPLE_RATES: [u32; 13] = [
    96_000, 88_200, 64_000, 48_000, 44_100, 32_000, 24_000, 22_050, 16_000, 12_000, 11_025, 8000,
    7350,
];
/// Samples per channel of a packet.
pub(crate) const FRAME: u32 = 1024;

const LC: u32 = 2;
const SBR: u32 = 5;
const PS: u32 = 29;
/// Marks of what follows the configuration proper.
const SBR_SYNC: u32 = 0x2b7;
const PS_SYNC: u32 = 0x548;

pub(super) const HE: &str = "HE-AAC (spectral band replication)";
const HE_V2: &str = "HE-AAC v2 (parametric stereo)";

/// AAC-LC of one or two channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Config {
    pub(crate) sample_rate: u32,
    pub(crate) channels: u16,
}

impl Config {
    /// Reads an AudioSpecificConfig.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, Refusal> {
        let cut = || Refusal::Corrupt("an AAC configuration cut off".into());
        let mut bits = Bits::new(bytes);
        let object = object_type(&mut bits).ok_or_else(cut)?;
        let sample_rate = sample_rate(&mut bits).ok_or_else(cut)?;
        let layout = bits.take(4).ok_or_else(cut)?;
        if object != LC {
            return Err(Refusal::Unsupported(name(object)));
        }
        let is_short = bits.take(1).ok_or_else(cut)? == 1;
        if bits.take(1).ok_or_else(cut)? == 1 {
            bits.take(14).ok_or_else(cut)?;
        }
        bits.take(1).ok_or_else(cut)?;
        if is_short {
            return Err(Refusal::Unsupported("AAC-LC with 960 samples in a frame".into()));
        }
        if let Some(extension) = extension(&mut bits) {
            return Err(Refusal::Unsupported(extension.into()));
        }
        Self::new(sample_rate, layout)
    }

    /// Checks what a header says; `layout` is the channel configuration of the standard.
    pub(super) fn new(sample_rate: u32, layout: u32) -> Result<Self, Refusal> {
        let channels = match layout {
            1 | 2 => layout as u16,
            0 => {
                let what = "AAC whose channels a program config element describes";
                return Err(Refusal::Unsupported(what.into()));
            }
            3..=6 => return Err(Refusal::Unsupported(format!("AAC of {layout} channels"))),
            7 | 12 | 14 => return Err(Refusal::Unsupported("AAC of 8 channels".into())),
            11 => return Err(Refusal::Unsupported("AAC of 7 channels".into())),
            _ => return Err(Refusal::Corrupt(format!("channel configuration {layout} in AAC"))),
        };
        match sample_rate {
            1..=96_000 => Ok(Self { sample_rate, channels }),
            rate => Err(Refusal::Corrupt(format!("AAC at {rate} Hz"))),
        }
    }

    /// A decoder of such packets.
    pub(crate) fn codec(&self) -> Result<Codec, Refusal> {
        // 5 bits object type, 4 bits rate, 24 bits Hz where they stand for no rate of the table,
        // 4 bits channels, 3 bits 0.
        let known = SAMPLE_RATES.iter().position(|rate| *rate == self.sample_rate);
        let (head, length) = match known {
            Some(index) => (u64::from(LC) << 4 | index as u64, 9),
            None => (u64::from(LC) << 28 | 15 << 24 | u64::from(self.sample_rate), 33),
        };
        let packed = head << (64 - length) | u64::from(self.channels) << (64 - length - 4);
        let bytes = &packed.to_be_bytes()[..(length + 7usize).div_ceil(8)];
        Codec::aac(bytes, self.channels.into(), self.sample_rate)
    }
}

fn object_type(bits: &mut Bits<'_>) -> Option<u32> {
    match bits.take(5)? {
        31 => Some(32 + bits.take(6)?),
        object => Some(object),
    }
}

fn sample_rate(bits: &mut Bits<'_>) -> Option<u32> {
    match bits.take(4)? {
        15 => bits.take(24),
        index => Some(rate_of(index)),
    }
}

/// The rate of an index; 0 for one that is reserved.
pub(super) fn rate_of(index: u32) -> u32 {
    SAMPLE_RATES.get(index as usize).copied().unwrap_or(0)
}

/// What a decoder of AAC-LC alone would leave out, where that is said after the configuration.
fn extension(bits: &mut Bits<'_>) -> Option<&'static str> {
    if bits.take(11)? != SBR_SYNC || object_type(bits)? != SBR || bits.take(1)? == 0 {
        return None;
    }
    let has_ps = |bits: &mut Bits<'_>| {
        sample_rate(bits)?;
        Some(bits.take(11)? == PS_SYNC && bits.take(1)? == 1)
    };
    Some(if has_ps(bits) == Some(true) { HE_V2 } else { HE })
}

/// Names of the object types.
pub(super) fn name(object: u32) -> String {
    let name = match object {
        1 => "AAC Main",
        3 => "AAC SSR",
        4 => "AAC LTP",
        SBR => HE,
        PS => HE_V2,
        17 => "error-resilient AAC",
        23 => "AAC-LD",
        32..=34 => "MPEG audio as an MPEG-4 object",
        36 => "MPEG-4 ALS",
        39 => "AAC-ELD",
        42 => "xHE-AAC (USAC)",
        _ => return format!("MPEG-4 audio of object type {object}"),
    };
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(bytes: &[u8]) -> String {
        match Config::parse(bytes) {
            Err(Refusal::Unsupported(what)) => what,
            Err(Refusal::Corrupt(what)) => format!("corrupt: {what}"),
            Ok(config) => format!("{config:?}"),
        }
    }

    #[test]
    fn configurations_are_read_and_written() {
        let lc = |sample_rate, channels| Config { sample_rate, channels };
        for (bytes, config) in [
            (&[0x12, 0x08][..], lc(44_100, 1)),
            (&[0x12, 0x10], lc(44_100, 2)),
            // LC with the mark of SBR, which says that there is none.
            (&[0x11, 0x90, 0x56, 0xe5, 0x00], lc(48_000, 2)),
            // A rate of its own: 12345 Hz.
            (&[0x17, 0x80, 0x18, 0x1c, 0x88], lc(12_345, 1)),
        ] {
            assert_eq!(Config::parse(bytes).ok(), Some(config));
            assert!(config.codec().is_ok());
        }
    }

    #[test]
    fn what_is_not_lc_is_named() {
        assert_eq!(refused(&[0x2b, 0x92, 0x08, 0x00]), HE);
        assert_eq!(refused(&[0xeb, 0x8a, 0x08, 0x00]), HE_V2);
        // LC, then the marks of SBR, and of SBR and PS.
        assert_eq!(refused(&[0x13, 0x90, 0x56, 0xe5, 0x98]), HE);
        assert_eq!(refused(&[0x13, 0x88, 0x56, 0xe5, 0x9d, 0x48, 0x80]), HE_V2);
        assert_eq!(refused(&[0x0a, 0x10]), "AAC Main");
        assert_eq!(refused(&[0x11, 0xb0]), "AAC of 6 channels");
        assert_eq!(refused(&[0x11, 0xb8]), "AAC of 8 channels");
        assert!(refused(&[0x11, 0x80]).contains("program config element"));
        assert!(refused(&[0x12, 0x14]).contains("960"));
        assert_eq!(refused(&[0xf9, 0x46, 0x40]), "xHE-AAC (USAC)");
        assert!(refused(&[0x16, 0x90]).starts_with("corrupt"));
        assert!(refused(&[0x12]).starts_with("corrupt"));
    }
}
