//! Which bytes are a sample, and what the `fmt ` chunk of WAV and Wave64 says of it.

use super::adpcm::{Adpcm, Kind};
use crate::error::AudioError;
use crate::report::Repair;
use crate::source::SampleEncoding;

/// Most channels that are read.
pub(crate) const MAX_CHANNELS: u16 = 64;
/// Highest sample rate that is read, in Hz.
pub(crate) const MAX_SAMPLE_RATE: u32 = 768_000;

const ENCODINGS: &str =
    "PCM of 1 to 64 bits, IEEE float of 32 or 64 bits, A-law, mu-law, IMA and Microsoft ADPCM";

/// Numeric values of `wFormatTag`; an EXTENSIBLE sub-format starts with the same number.
mod tag {
    pub const PCM: u32 = 1;
    pub const MS_ADPCM: u32 = 2;
    pub const FLOAT: u32 = 3;
    pub const ALAW: u32 = 6;
    pub const MULAW: u32 = 7;
    pub const IMA_ADPCM: u32 = 0x11;
    pub const EXTENSIBLE: u32 = 0xfffe;
}

/// How one sample is stored. Integers that do not fill their bytes are left-justified there, so
/// the container alone decides the scaling.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Unsigned 8-bit.
    U8,
    /// Signed, 1 to 8 bytes.
    Int(u8),
    /// IEEE single precision.
    F32,
    /// IEEE double precision.
    F64,
    /// ITU-T G.711 A-law.
    ALaw,
    /// ITU-T G.711 mu-law.
    MuLaw,
    /// Blocks of 4-bit differences.
    Adpcm(Adpcm),
}

impl Encoding {
    /// Bytes per sample.
    pub(crate) fn bytes(self) -> u16 {
        match self {
            Self::U8 | Self::ALaw | Self::MuLaw => 1,
            Self::Int(n) => u16::from(n),
            Self::F32 => 4,
            Self::F64 => 8,
            // Blocks hold all channels: see `Format::unit_bytes`.
            Self::Adpcm(_) => 0,
        }
    }

    /// What a caller is told.
    pub(crate) fn samples(self) -> SampleEncoding {
        match self {
            Self::U8 => SampleEncoding::Unsigned8,
            Self::Int(bytes) => SampleEncoding::Signed { bytes },
            Self::F32 => SampleEncoding::Float { bytes: 4 },
            Self::F64 => SampleEncoding::Float { bytes: 8 },
            Self::ALaw => SampleEncoding::ALaw,
            Self::MuLaw => SampleEncoding::MuLaw,
            Self::Adpcm(_) => SampleEncoding::Adpcm,
        }
    }

    /// ffmpeg's name of the encoding.
    pub(crate) fn name(self, big_endian: bool) -> String {
        let order = if big_endian { "be" } else { "le" };
        match self {
            Self::U8 => "pcm_u8".into(),
            Self::Int(1) => "pcm_s8".into(),
            Self::Int(n) => format!("pcm_s{}{order}", 8 * u16::from(n)),
            Self::F32 => format!("pcm_f32{order}"),
            Self::F64 => format!("pcm_f64{order}"),
            Self::ALaw => "pcm_alaw".into(),
            Self::MuLaw => "pcm_mulaw".into(),
            Self::Adpcm(Adpcm { kind: Kind::Ima, .. }) => "adpcm_ima_wav".into(),
            Self::Adpcm(Adpcm { kind: Kind::Microsoft, .. }) => "adpcm_ms".into(),
        }
    }
}

/// What the `fmt ` chunk says, validated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Format {
    pub(crate) channels: u16,
    pub(crate) sample_rate: u32,
    pub(crate) encoding: Encoding,
    pub(crate) repair: Option<Repair>,
}

/// Byte order of the header fields and samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Endian {
    Little,
    Big,
}

impl Endian {
    pub(crate) fn u16(self, b: [u8; 2]) -> u16 {
        if self == Self::Big { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) }
    }

    pub(crate) fn u32(self, b: [u8; 4]) -> u32 {
        if self == Self::Big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) }
    }

    pub(crate) fn u64(self, b: [u8; 8]) -> u64 {
        if self == Self::Big { u64::from_be_bytes(b) } else { u64::from_le_bytes(b) }
    }
}

impl Format {
    /// A format of samples that stand side by side, checked.
    pub(super) fn new(
        channels: u32,
        sample_rate: f64,
        encoding: Encoding,
        at: u64,
    ) -> Result<Self, AudioError> {
        const EXPECTED: &str = "1 to 64 channels at 1 to 768000 Hz";
        let actual = format!("{channels} channels at {sample_rate} Hz");
        if channels == 0 || !sample_rate.is_finite() || sample_rate < 1.0 {
            return Err(AudioError::corrupt(at, actual, EXPECTED));
        }
        match u16::try_from(channels) {
            Ok(channels @ 1..=MAX_CHANNELS) if sample_rate <= f64::from(MAX_SAMPLE_RATE) => {
                Ok(Self {
                    channels,
                    sample_rate: sample_rate.round() as u32,
                    encoding,
                    repair: None,
                })
            }
            _ => Err(AudioError::unsupported(at, actual, EXPECTED)),
        }
    }

    /// Bytes of what cannot be divided: one sample of every channel, or a block.
    pub(crate) fn unit_bytes(&self) -> u64 {
        match self.encoding {
            Encoding::Adpcm(adpcm) => adpcm.block.into(),
            encoding => u64::from(encoding.bytes()) * u64::from(self.channels),
        }
    }

    /// Samples per channel in so many bytes of data.
    pub(crate) fn frames_in(&self, bytes: u64) -> u64 {
        match self.encoding {
            Encoding::Adpcm(adpcm) => adpcm.frames_in(bytes, self.channels),
            _ => bytes / self.unit_bytes(),
        }
    }

    /// Parses the body of the chunk (its first 40 bytes suffice), which starts at byte `at`.
    ///
    /// ```text
    /// 0  u16 wFormatTag       8  u32 nAvgBytesPerSec    16 u16 cbSize
    /// 2  u16 nChannels       12  u16 nBlockAlign        18 u16 wValidBitsPerSample
    /// 4  u32 nSamplesPerSec  14  u16 wBitsPerSample     20 u32 dwChannelMask, 24 GUID
    /// ```
    /// The average byte rate, `cbSize`, the valid bits and the speakers are not used: real files
    /// have them wrong and the samples do not depend on them.
    pub(crate) fn parse(body: &[u8], endian: Endian, at: u64) -> Result<Self, AudioError> {
        let Some(base) = body.first_chunk::<16>() else {
            let actual = format!("fmt chunk of {} bytes", body.len());
            return Err(AudioError::corrupt(at, actual, "at least 16"));
        };
        let [t0, t1, c0, c1, r0, r1, r2, r3, _, _, _, _, a0, a1, b0, b1] = *base;
        let channels = endian.u16([c0, c1]);
        let sample_rate = endian.u32([r0, r1, r2, r3]);
        let block_align = endian.u16([a0, a1]);
        let bits = endian.u16([b0, b1]);
        let outer_tag = u32::from(endian.u16([t0, t1]));
        let extensible = outer_tag == tag::EXTENSIBLE;
        let format_tag = if extensible { sub_format(body, endian, at)? } else { outer_tag };

        match channels {
            0 => return Err(AudioError::corrupt(at + 2, "0 channels", "1 to 64")),
            1..=MAX_CHANNELS => {}
            n => return Err(AudioError::unsupported(at + 2, format!("{n} channels"), "1 to 64")),
        }
        match sample_rate {
            0 => return Err(AudioError::corrupt(at + 4, "sample rate 0 Hz", "1 to 768000 Hz")),
            1..=MAX_SAMPLE_RATE => {}
            n => {
                let actual = format!("sample rate {n} Hz");
                return Err(AudioError::unsupported(at + 4, actual, "1 to 768000 Hz"));
            }
        }
        // Bytes per sample according to the block alignment, where that is possible at all.
        let aligned = block_align.is_multiple_of(channels).then(|| block_align / channels);
        let encoding = match (format_tag, bits) {
            (tag::PCM, 1..=64) => {
                let least = bits.div_ceil(8);
                match aligned {
                    Some(wide @ 1..=8) if wide > least && !extensible => {
                        // Readers disagree on which bytes count; the standard has no such files.
                        let actual = format!("PCM of {bits} bits in {wide} bytes");
                        let expected = "a wider container only with WAVE_FORMAT_EXTENSIBLE";
                        return Err(AudioError::unsupported(at + 12, actual, expected));
                    }
                    Some(wide @ 1..=8) if wide >= least => integer(wide),
                    _ => integer(least),
                }
            }
            (tag::FLOAT, 32) => Encoding::F32,
            (tag::FLOAT, 64) => Encoding::F64,
            (tag::ALAW, 8) => Encoding::ALaw,
            (tag::MULAW, 8) => Encoding::MuLaw,
            (tag::IMA_ADPCM, 4) => adpcm(Kind::Ima, block_align, channels, at)?,
            (tag::MS_ADPCM, 4) => adpcm(Kind::Microsoft, block_align, channels, at)?,
            (tag, bits) => {
                let actual = match named(tag) {
                    Some(name) => format!("{name} in WAV"),
                    None => format!("format tag {tag:#06x} with {bits} bits"),
                };
                return Err(AudioError::unsupported(at, actual, ENCODINGS));
            }
        };
        let frame = encoding.bytes() * channels;
        let repair = (block_align != frame && frame > 0)
            .then(|| Repair::BlockAlign { declared: block_align.into(), used: frame.into() });
        Ok(Self { channels, sample_rate, encoding, repair })
    }
}

fn adpcm(kind: Kind, block: u16, channels: u16, at: u64) -> Result<Encoding, AudioError> {
    let adpcm = Adpcm { kind, block };
    if adpcm.frames_in(block.into(), channels) == 0 {
        let actual = format!("ADPCM in blocks of {block} bytes for {channels} channels");
        return Err(AudioError::corrupt(at + 12, actual, "blocks that hold samples"));
    }
    Ok(Encoding::Adpcm(adpcm))
}

fn integer(bytes: u16) -> Encoding {
    if bytes == 1 { Encoding::U8 } else { Encoding::Int(bytes as u8) }
}

/// Formats in WAV that are not read.
fn named(tag: u32) -> Option<&'static str> {
    Some(match tag {
        0x0020 => "Yamaha ADPCM",
        0x0031 | 0x0032 => "GSM 6.10",
        0x0040 | 0x0045 | 0x0064 => "G.726",
        0x0050 => "MP1 or MP2",
        0x0055 => "MP3",
        0x0092 | 0x2000 => "AC-3",
        0x00ff | 0x1600 | 0x1602 | 0x1610 | 0x4143 => "AAC",
        0x0160..=0x0163 => "Windows Media Audio",
        0x2001 => "DTS",
        0x5346 => "Flash ADPCM",
        0x674f | 0x6750 | 0x6751 | 0x676f | 0x6770 | 0x6771 => "Vorbis",
        0x704f => "Opus",
        0xf1ac => "FLAC",
        _ => return None,
    })
}

/// The format tag in the GUID of WAVE_FORMAT_EXTENSIBLE: its first field, followed by the same
/// 12 bytes for all of them.
fn sub_format(body: &[u8], endian: Endian, at: u64) -> Result<u32, AudioError> {
    const LITTLE: [u8; 4] = [0x00, 0x00, 0x10, 0x00];
    const BIG: [u8; 4] = [0x00, 0x00, 0x00, 0x10];
    const TAIL: [u8; 8] = [0x80, 0x00, 0x00, 0xaa, 0x00, 0x38, 0x9b, 0x71];
    // Ambisonic B-format: the same tags with another rest.
    const AMBISONIC: [u8; 12] =
        [0x21, 0x07, 0xd3, 0x11, 0x86, 0x44, 0xc8, 0xc1, 0xca, 0x00, 0x00, 0x00];
    let Some(guid) = body.get(24..40) else {
        let actual = format!("WAVE_FORMAT_EXTENSIBLE in a fmt chunk of {} bytes", body.len());
        return Err(AudioError::corrupt(at, actual, "at least 40"));
    };
    let middle = if endian == Endian::Big { BIG } else { LITTLE };
    let is_plain = guid[4..8] == middle && guid[8..16] == TAIL;
    if !is_plain && (endian == Endian::Big || guid[4..] != AMBISONIC) {
        let actual = format!("sub-format {:02x?}", guid);
        return Err(AudioError::unsupported(at + 24, actual, ENCODINGS));
    }
    Ok(endian.u32([guid[0], guid[1], guid[2], guid[3]]))
}
