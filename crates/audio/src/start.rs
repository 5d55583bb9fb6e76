//! Where in a file the audio begins, and of which format it is.

use crate::error::AudioError;
use crate::input::Input;
use crate::pcm::Container;
use crate::tags;

/// Bytes before the audio that are searched for its beginning, tags not counted.
const SEARCHED: usize = 64 << 10;
/// Bytes after them that show a chain of frames which begins in them.
#[cfg(feature = "symphonia")]
const CHAIN: usize = if crate::aac::WINDOW > crate::mpeg::WINDOW {
    crate::aac::WINDOW / 2
} else {
    crate::mpeg::WINDOW / 2
};
#[cfg(not(feature = "symphonia"))]
const CHAIN: usize = MARK;
/// The longest mark that is sure.
const MARK: usize = 24;

/// A format by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Pcm(Container),
    /// One that is not read.
    Other(&'static str),
    #[cfg(feature = "symphonia")]
    Flac,
    #[cfg(feature = "symphonia")]
    Mpeg,
    #[cfg(feature = "symphonia")]
    Ogg,
    #[cfg(feature = "symphonia")]
    Mp4,
    /// In ADTS.
    #[cfg(feature = "symphonia")]
    Aac,
}

/// Bytes that tell a format.
const SHOWN: usize = 16;

/// Formats that are not read: place and bytes of their mark, and their name.
const OTHERS: [(usize, &[u8], &str); 23] = [
    (0, b"\0\x05\x16\x07", "macOS metadata (AppleDouble)"),
    (4, b"ftyp", "MP4"),
    (0, b"\x1a\x45\xdf\xa3", "Matroska or WebM"),
    (0, b"\x30\x26\xb2\x75\x8e\x66\xcf\x11", "ASF (WMA)"),
    (0, b"\x0b\x77", "AC-3"),
    (0, b"\x7f\xfe\x80\x01", "DTS"),
    (0, b"wvpk", "WavPack"),
    (0, b"MAC ", "Monkey's Audio"),
    (0, b"TTA1", "True Audio"),
    (0, b"MPCK", "Musepack"),
    (0, b"MP+", "Musepack"),
    (0, b"OFR ", "OptimFROG"),
    (0, b"DSD ", "DSF"),
    (0, b"FRM8", "DSDIFF"),
    (0, b"#!AMR", "AMR"),
    (0, b"NIST_1A", "NIST SPHERE"),
    (0, b"Creative Voice File", "Creative VOC"),
    (0, b"MThd", "MIDI"),
    (0, b".RMF", "RealMedia"),
    (0, b"FLV\x01", "Flash video"),
    (0, b"ajkg", "Shorten"),
    (0, b"2BIT", "AVR"),
    (8, b"8SVX", "8SVX"),
];

/// Goes to the first byte of the audio: after tags and, where nothing known starts the file, after
/// what is not audio. `None` where no format is recognised.
pub(crate) fn find(input: &mut Input) -> Result<Option<Format>, AudioError> {
    tags::skip(input)?;
    if let Some(format) = at_start(input.peek(SHOWN)?) {
        return Ok(Some(format));
    }
    let shown = input.peek(SEARCHED + CHAIN)?;
    // No more than a pipe is sure to show.
    let shown = &shown[..shown.len().min(SEARCHED + CHAIN)];
    let is_end = shown.len() < SEARCHED + CHAIN;
    let sure = (0..shown.len()).find_map(|at| Some((at, surely(&shown[at..])?)));
    // What begins first counts; the other stands after the audio, or in it.
    let found = [sure, frames(shown, is_end)].into_iter().flatten().min_by_key(|(at, _)| *at);
    if let Some((at, format)) = found.filter(|(at, _)| *at < SEARCHED) {
        input.consume(at);
        return Ok(Some(format));
    }
    #[cfg(feature = "symphonia")]
    if input.position() > 0 || crate::mpeg::is_header(input.peek(4)?) {
        // A tag and nothing after it, or a frame header and no whole frame.
        return Ok(Some(Format::Mpeg));
    }
    Ok(None)
}

/// The format that starts here, by the mark that every file of it has.
fn at_start(start: &[u8]) -> Option<Format> {
    if let Some(container) = Container::of(start) {
        return Some(Format::Pcm(container));
    }
    #[cfg(feature = "symphonia")]
    {
        if crate::flac::is_flac(start) {
            return Some(Format::Flac);
        }
        if start.starts_with(b"OggS") {
            return Some(Format::Ogg);
        }
        if crate::mp4::is_mp4(start) {
            return Some(Format::Mp4);
        }
    }
    OTHERS
        .iter()
        .find(|(at, mark, _)| start.get(*at..).is_some_and(|s| s.starts_with(mark)))
        .map(|(_, _, name)| Format::Other(name))
}

/// As `at_start`, but with as many bytes right as make chance unlikely.
fn surely(bytes: &[u8]) -> Option<Format> {
    match bytes {
        [b'R', b'I' | b'F', b'F' | b'6', ..] if bytes.get(8..12) == Some(b"WAVE") => {
            Container::of(&bytes[..12]).map(Format::Pcm)
        }
        [b'F', b'O', b'R', b'M', ..] | [b'r', b'i', b'f', b'f', ..] => {
            Container::of(&bytes[..bytes.len().min(SHOWN)]).map(Format::Pcm)
        }
        [b'c', b'a', b'f', b'f', 0, 1, _, _, b'd', b'e', b's', b'c', ..]
        | [b'.', b's', b'n', b'd', 0, ..]
        | [b'd', b'n', b's', b'.', _, _, _, 0, ..]
            if has_likely_fields(bytes) =>
        {
            Container::of(&bytes[..SHOWN]).map(Format::Pcm)
        }
        #[cfg(feature = "symphonia")]
        [b'f', b'L', b'a', b'C', 0 | 0x80, 0, 0, 34, ..] => Some(Format::Flac),
        #[cfg(feature = "symphonia")]
        [b'O', b'g', b'g', b'S', 0, 2, 0, 0, ..] => Some(Format::Ogg),
        _ => None,
    }
}

/// Whether CAF, or AU with a known encoding and few channels, starts here.
fn has_likely_fields(bytes: &[u8]) -> bool {
    let Some(head) = bytes.first_chunk::<MARK>() else { return false };
    let field = |at: usize| {
        let field = [head[at], head[at + 1], head[at + 2], head[at + 3]];
        if head[0] == b'.' { u32::from_be_bytes(field) } else { u32::from_le_bytes(field) }
    };
    head[0] == b'c' || (matches!(field(12), 1..=7 | 27) && (1..=64).contains(&field(20)))
}

/// MPEG audio and AAC have no mark but the headers of their frames.
#[cfg(feature = "symphonia")]
fn frames(shown: &[u8], is_end: bool) -> Option<(usize, Format)> {
    let standard = crate::mpeg::find(shown, is_end, 2);
    let free = crate::mpeg::find_free(shown);
    let mpeg = [standard, free].into_iter().flatten().min().map(|at| (at, Format::Mpeg));
    let aac = crate::aac::find(shown, is_end, 2).map(|at| (at, Format::Aac));
    [mpeg, aac].into_iter().flatten().min_by_key(|(at, _)| *at)
}

#[cfg(not(feature = "symphonia"))]
fn frames(_: &[u8], _: bool) -> Option<(usize, Format)> {
    None
}
