//! The tracks of a movie (`moov`): which one is read, and what it holds.

use super::boxes::{child, children, descend, u16_at, u32_at};
use super::edits::{Scales, Timeline, smpb};
use super::table::Table;
use crate::aac::{Config, FRAME};
use crate::codec::{Codec, Refusal};
use crate::pcm::{MAX_CHANNELS, MAX_SAMPLE_RATE};

/// Largest frame of ALAC, in samples per channel, that the decoder takes.
const MAX_ALAC_FRAME: u32 = 1 << 16;

/// What packets hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Coding {
    Aac(Config),
    Alac { cookie: Vec<u8>, sample_rate: u32, channels: u16, frame: u32 },
}

impl Coding {
    pub(super) fn sample_rate(&self) -> u32 {
        match self {
            Self::Aac(config) => config.sample_rate,
            Self::Alac { sample_rate, .. } => *sample_rate,
        }
    }

    pub(super) fn channels(&self) -> u16 {
        match self {
            Self::Aac(config) => config.channels,
            Self::Alac { channels, .. } => *channels,
        }
    }

    /// Samples per channel of a whole packet.
    pub(super) fn frame(&self) -> u32 {
        match self {
            Self::Aac(_) => FRAME,
            Self::Alac { frame, .. } => *frame,
        }
    }

    /// Where the decoder has the channels that ffmpeg gives in this order, that of WAV with surrounds
    /// behind the listener; `None` where both agree.
    pub(super) fn order(&self) -> Option<&'static [usize]> {
        match self {
            Self::Alac { channels: 7, .. } => Some(&[0, 1, 2, 3, 5, 6, 4]),
            Self::Alac { channels: 8, .. } => Some(&[0, 1, 2, 3, 6, 7, 4, 5]),
            _ => None,
        }
    }

    pub(super) fn codec(&self) -> Result<Codec, Refusal> {
        match self {
            Self::Aac(config) => config.codec(),
            Self::Alac { cookie, sample_rate, channels, .. } => {
                Codec::alac(cookie, (*channels).into(), *sample_rate)
            }
        }
    }
}

/// The track that is read.
#[derive(Debug)]
pub(super) struct Track {
    pub(super) coding: Coding,
    pub(super) scales: Scales,
    pub(super) table: Table,
    pub(super) timeline: Timeline,
    /// Frames of all packets, in a file without fragments.
    pub(super) length: Option<u64>,
    pub(super) fragments: Option<Defaults>,
}

/// What packets in fragments have unless these say otherwise.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Defaults {
    pub(super) track: u32,
    pub(super) description: u32,
    pub(super) duration: u32,
    pub(super) size: u32,
}

impl Track {
    /// The first track with audio that is read.
    pub(super) fn parse(moov: &[u8]) -> Result<Self, Refusal> {
        let mut refused: Option<Refusal> = None;
        let mut others = Vec::new();
        if child(moov, b"cmov").is_some() {
            return Err(Refusal::Unsupported("MP4 whose index is compressed".into()));
        }
        for (_, trak) in children(moov).filter(|(kind, _)| kind == b"trak") {
            let handler = descend(trak, &[b"mdia", b"hdlr"]).and_then(|body| body.get(8..12));
            if handler != Some(b"soun") {
                others.push(handler.unwrap_or(b"none").escape_ascii().to_string());
                continue;
            }
            match Self::of(moov, trak) {
                Ok(track) => return Ok(track),
                Err(refusal) => refused = refused.or(Some(refusal)),
            }
        }
        Err(refused.unwrap_or_else(|| {
            let tracks = if others.is_empty() { "none".into() } else { others.join(", ") };
            Refusal::Unsupported(format!("MP4 without sound (tracks: {tracks})"))
        }))
    }

    fn of(moov: &[u8], trak: &[u8]) -> Result<Self, Refusal> {
        let incomplete =
            |what: &str| Refusal::Corrupt(format!("an MP4 track without usable {what}"));
        let mdia = child(trak, b"mdia").ok_or_else(|| incomplete("mdia"))?;
        let stbl = descend(mdia, &[b"minf", b"stbl"]).ok_or_else(|| incomplete("stbl"))?;
        let description = child(stbl, b"stsd").and_then(|body| children(body.get(8..)?).next());
        let (kind, entry) = description.ok_or_else(|| incomplete("stsd"))?;
        let coding = coding(kind, entry)?;
        let sample_rate = coding.sample_rate();
        let scale = |body: Option<&[u8]>| {
            let body = body?;
            u32_at(body, if body.first() == Some(&1) { 20 } else { 12 }).filter(|n| *n > 0)
        };
        let scales = Scales {
            movie: scale(child(moov, b"mvhd")).unwrap_or(1000),
            track: scale(child(mdia, b"mdhd")).ok_or_else(|| incomplete("mdhd"))?,
            sample_rate,
        };
        let table = Table::parse(stbl);
        let fragments = child(moov, b"mvex").map(|mvex| {
            let id = child(trak, b"tkhd")
                .and_then(|body| u32_at(body, if body.first() == Some(&1) { 20 } else { 12 }));
            defaults(mvex, id.unwrap_or(0))
        });
        let frame = coding.frame();
        let length = fragments.is_none().then(|| {
            let (ticks, last) = table.duration(frame);
            let frames = super::edits::frames(ticks, scales.track, sample_rate);
            // Where packets last as long as they are, only the last one can say more.
            match last.filter(|_| scales.track == sample_rate) {
                Some(0) => frames.saturating_add(frame.into()),
                Some(last) if last > frame => frames - u64::from(last - frame),
                _ => frames,
            }
        });
        let smpb = if matches!(coding, Coding::Aac(_)) { smpb(moov) } else { None };
        let timeline = Timeline::parse(trak, scales, length, smpb).map_err(Refusal::Unsupported)?;
        Ok(Self { coding, scales, table, timeline, length, fragments })
    }
}

/// `trex`: version and flags, track, description, duration, size.
fn defaults(mvex: &[u8], track: u32) -> Defaults {
    let own = children(mvex)
        .filter(|(kind, _)| kind == b"trex")
        .map(|(_, body)| body)
        .find(|body| u32_at(body, 4) == Some(track));
    let number = |at: usize| own.and_then(|body| u32_at(body, at)).unwrap_or(0);
    Defaults { track, description: number(8), duration: number(12), size: number(16) }
}

/// Codings that are not read, by the type of their description.
const OTHERS: [(&[u8; 4], &str); 25] = [
    (b".mp3", "MP3"),
    (b"ac-3", "AC-3"),
    (b"ec-3", "E-AC-3"),
    (b"ac-4", "AC-4"),
    (b"mlpa", "MLP"),
    (b"samr", "AMR-NB"),
    (b"sawb", "AMR-WB"),
    (b"sevc", "EVRC"),
    (b"sqcp", "QCELP"),
    (b"Opus", "Opus"),
    (b"fLaC", "FLAC"),
    (b"enca", "encrypted audio (DRM)"),
    (b"drms", "encrypted audio (DRM)"),
    (b"dtsc", "DTS"),
    (b"twos", "PCM"),
    (b"sowt", "PCM"),
    (b"lpcm", "PCM"),
    (b"ipcm", "PCM"),
    (b"raw ", "PCM"),
    (b"in24", "PCM"),
    (b"in32", "PCM"),
    (b"fl32", "PCM"),
    (b"ulaw", "mu-law"),
    (b"alaw", "A-law"),
    (b"ima4", "IMA ADPCM"),
];

/// What the description of a track says of its packets.
///
/// ```text
/// 0 6 bytes, u16 reference   8 u16 version (of QuickTime)   16 u16 channels   24 u32 Hz
/// 28 boxes; in versions 1 and 2 of QuickTime 16 or 36 bytes later, or inside of `wave`
/// ```
fn coding(kind: [u8; 4], entry: &[u8]) -> Result<Coding, Refusal> {
    if let Some((_, name)) = OTHERS.iter().find(|(known, _)| **known == kind) {
        return Err(Refusal::Unsupported(format!("MP4 with {name}")));
    }
    let at = match u16_at(entry, 8) {
        Some(1) => 28 + 16,
        Some(2) => 28 + 36,
        _ => 28,
    };
    let inside = |kind: &[u8; 4]| {
        let boxes = entry.get(at..)?;
        child(boxes, kind).or_else(|| descend(boxes, &[b"wave", kind]))
    };
    match &kind {
        b"mp4a" => {
            let stream = inside(b"esds").and_then(|body| stream_of(body.get(4..)?));
            let (object, config) = stream.ok_or_else(|| {
                Refusal::Corrupt("an MP4 track of AAC without its description (esds)".into())
            })?;
            match object {
                0x40 | 0x66..=0x68 => Ok(Coding::Aac(Config::parse(config)?)),
                0x69 | 0x6b => Err(Refusal::Unsupported("MP4 with MP3".into())),
                0xa5 => Err(Refusal::Unsupported("MP4 with AC-3".into())),
                0xa9 => Err(Refusal::Unsupported("MP4 with DTS".into())),
                0xdd => Err(Refusal::Unsupported("MP4 with Vorbis".into())),
                object => {
                    Err(Refusal::Unsupported(format!("MP4 with audio of object {object:#04x}")))
                }
            }
        }
        b"alac" => inside(b"alac").and_then(|body| alac(body.get(4..)?)).ok_or_else(|| {
            Refusal::Corrupt("an MP4 track of ALAC without a usable description".into())
        }),
        kind => Err(Refusal::Unsupported(format!("MP4 with \"{}\"", kind.escape_ascii()))),
    }
}

/// ```text
/// 0 u32 samples per channel of a frame   5 u8 bits   9 u8 channels   20 u32 Hz   24 channel layout
/// ```
fn alac(cookie: &[u8]) -> Option<Coding> {
    let cookie = cookie.get(..48).or_else(|| cookie.get(..24))?;
    let frame = u32_at(cookie, 0)?;
    let (bits, channels, sample_rate) = (cookie[5], u16::from(cookie[9]), u32_at(cookie, 20)?);
    let is_usable = (1..=MAX_ALAC_FRAME).contains(&frame)
        && (1..=32).contains(&bits)
        && (1..=MAX_CHANNELS).contains(&channels)
        && (1..=MAX_SAMPLE_RATE).contains(&sample_rate);
    is_usable.then(|| Coding::Alac { cookie: cookie.to_vec(), sample_rate, channels, frame })
}

/// The object type and the configuration in the descriptors of `esds` (ISO 14496-1, 7.2.6).
fn stream_of(esds: &[u8]) -> Option<(u8, &[u8])> {
    const STREAM: u8 = 3;
    const DECODER: u8 = 4;
    const CONFIG: u8 = 5;
    // u16 id, u8 flags: what else stands before the next descriptor.
    let stream = descriptor(esds, STREAM)?;
    let flags = *stream.get(2)?;
    let mut at = 3;
    if flags & 0x80 != 0 {
        at += 2;
    }
    if flags & 0x40 != 0 {
        at += 1 + usize::from(*stream.get(at)?);
    }
    if flags & 0x20 != 0 {
        at += 2;
    }
    let decoder = descriptor(stream.get(at..)?, DECODER)?;
    Some((*decoder.first()?, descriptor(decoder.get(13..)?, CONFIG).unwrap_or_default()))
}

/// The body of the first descriptor with a tag: its length stands before it, 7 bits a byte.
fn descriptor(mut bytes: &[u8], tag: u8) -> Option<&[u8]> {
    loop {
        let (&found, mut rest) = bytes.split_first()?;
        let mut length = 0usize;
        for _ in 0..4 {
            let (&byte, more) = rest.split_first()?;
            rest = more;
            length = length << 7 | usize::from(byte & 0x7f);
            if byte < 0x80 {
                break;
            }
        }
        let (body, more) = rest.split_at(length.min(rest.len()));
        if found == tag {
            return Some(body);
        }
        bytes = more;
    }
}
