//! Where in a file the audio begins, and of which format it is.

use crate::error::AudioError;
use crate::input::Input;
use crate::tags;
use crate::wav;

/// Bytes before the audio that are searched for its beginning, tags not counted.
const SEARCHED: usize = 64 << 10;

/// A format by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Wav,
    #[cfg(feature = "symphonia")]
    Flac,
    #[cfg(feature = "symphonia")]
    Mpeg,
    #[cfg(feature = "symphonia")]
    Ogg,
}

/// Goes to the first byte of the audio: behind tags and, where nothing known starts the file, behind
/// what is no audio. `None` where no format is recognised.
pub(crate) fn find(input: &mut Input) -> Result<Option<Format>, AudioError> {
    tags::skip(input)?;
    if let Some(format) = at_start(input.peek(12)?) {
        return Ok(Some(format));
    }
    let shown = input.peek(SEARCHED)?;
    let is_end = shown.len() < SEARCHED;
    let sure = (0..shown.len()).find_map(|at| Some((at, surely(&shown[at..])?)));
    let found = sure.or_else(|| frames(shown, is_end));
    if let Some((at, format)) = found {
        input.consume(at);
        return Ok(Some(format));
    }
    #[cfg(feature = "symphonia")]
    if input.position() > 0 || crate::mpeg::is_header(input.peek(4)?) {
        // A tag and nothing behind it, or a frame header and no whole frame.
        return Ok(Some(Format::Mpeg));
    }
    Ok(None)
}

/// The format that starts here, by the mark that every file of it has.
fn at_start(start: &[u8]) -> Option<Format> {
    if wav::is_wav(start) {
        return Some(Format::Wav);
    }
    #[cfg(feature = "symphonia")]
    {
        if crate::flac::is_flac(start) {
            return Some(Format::Flac);
        }
        if start.starts_with(b"OggS") {
            return Some(Format::Ogg);
        }
    }
    None
}

/// As `at_start`, but with as many bytes right as make chance unlikely.
fn surely(bytes: &[u8]) -> Option<Format> {
    let is_wav = bytes.len() >= 12 && bytes.starts_with(b"R") && wav::is_wav(&bytes[..12]);
    match bytes {
        _ if is_wav => Some(Format::Wav),
        #[cfg(feature = "symphonia")]
        [b'f', b'L', b'a', b'C', 0 | 0x80, 0, 0, 34, ..] => Some(Format::Flac),
        #[cfg(feature = "symphonia")]
        [b'O', b'g', b'g', b'S', 0, 2, 0, 0, ..] => Some(Format::Ogg),
        _ => None,
    }
}

/// MPEG audio has no mark but the headers of its frames.
#[cfg(feature = "symphonia")]
fn frames(shown: &[u8], is_end: bool) -> Option<(usize, Format)> {
    let free = crate::mpeg::is_free_format(shown).then_some(0);
    crate::mpeg::find(shown, is_end, 2).or(free).map(|at| (at, Format::Mpeg))
}

#[cfg(not(feature = "symphonia"))]
fn frames(_: &[u8], _: bool) -> Option<(usize, Format)> {
    None
}
