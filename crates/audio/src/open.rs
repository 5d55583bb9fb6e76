//! Chooses the reader by what the file holds.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use crate::error::AudioError;
use crate::input::{Input, Medium, Seekable, Stream};
use crate::source::BlockSource;
use crate::start::{self, Format};

/// File name extensions (lower case) that a walk through folders should pick up. Files are still
/// opened by content, whatever they are called.
#[cfg(feature = "symphonia")]
pub const EXTENSIONS: [&str; 26] = [
    "wav", "wave", "rf64", "bw64", "bwf", "w64", "aif", "aiff", "aifc", "au", "snd", "caf", "flac",
    "ogg", "oga", "opus", "mp1", "mp2", "mp3", "mpga", "amb", "m4a", "m4b", "aac", "adts", "3ga",
];
/// File name extensions (lower case) that a walk through folders should pick up. Files are still
/// opened by content, whatever they are called.
#[cfg(not(feature = "symphonia"))]
pub const EXTENSIONS: [&str; 13] =
    ["wav", "wave", "rf64", "bw64", "bwf", "w64", "aif", "aiff", "aifc", "au", "snd", "caf", "amb"];

/// File name extensions (lower case) of recordings in formats that are not read, and of videos,
/// which are read where they are named: a walk through folders says what it passes over.
pub const OTHER_EXTENSIONS: [&str; 34] = [
    "3gp", "8svx", "aa3", "ac3", "amr", "ape", "asf", "avi", "dff", "dsf", "dts", "eac3", "gsm",
    "iff", "m4v", "mka", "mkv", "mov", "mp4", "mpc", "ofr", "ra", "rm", "sd2", "shn", "sph", "spx",
    "tak", "thd", "tta", "voc", "webm", "wma", "wv",
];

#[cfg(feature = "symphonia")]
const FORMATS: &str = "WAV, Wave64, AIFF, AU, CAF, FLAC, Ogg (Vorbis, Opus, FLAC), MPEG audio (MP1, MP2, MP3), MP4 \
     (AAC, ALAC) or AAC in ADTS";
#[cfg(not(feature = "symphonia"))]
const FORMATS: &str = "WAV (RIFF, RIFX, RF64, BW64), Wave64, AIFF, AU or CAF";

/// Opens a recording, by content.
///
/// # Errors
/// The file cannot be opened or read, is empty, no audio, of an unsupported kind, or corrupt.
pub fn open(path: &Path) -> Result<Box<dyn BlockSource>, AudioError> {
    let failed = |source| AudioError::Open { path: path.to_owned(), source };
    let file = File::open(path).map_err(failed)?;
    let meta = file.metadata().map_err(failed)?;
    if meta.is_dir() {
        return Err(failed(std::io::ErrorKind::IsADirectory.into()));
    }
    if meta.is_file() { from_seekable(file) } else { from_reader(file) }
}

/// Reads a recording from a stream such as standard input, forward only.
///
/// # Errors
/// As [`open`].
pub fn from_reader(reader: impl Read + Send + 'static) -> Result<Box<dyn BlockSource>, AudioError> {
    from_medium(Box::new(Stream(reader)))
}

/// Reads a recording from anything that can seek, such as bytes in a [`std::io::Cursor`].
///
/// # Errors
/// As [`open`].
pub fn from_seekable(
    reader: impl Read + Seek + Send + 'static,
) -> Result<Box<dyn BlockSource>, AudioError> {
    let medium = Seekable::new(reader).map_err(|source| AudioError::Io { offset: 0, source })?;
    from_medium(Box::new(medium))
}

fn from_medium(medium: Box<dyn Medium>) -> Result<Box<dyn BlockSource>, AudioError> {
    let mut input = Input::new(medium);
    let start = input.peek(12)?;
    if start.is_empty() {
        return Err(AudioError::Empty);
    }
    let found = format!("\"{}\"", start[..start.len().min(12)].escape_ascii());
    match start::find(&mut input)? {
        Some(Format::Pcm(container)) => crate::pcm::open(input, container),
        Some(Format::Other(name)) => Err(AudioError::unsupported(input.position(), name, FORMATS)),
        #[cfg(feature = "symphonia")]
        Some(Format::Flac) => crate::flac::open(input),
        #[cfg(feature = "symphonia")]
        Some(Format::Mpeg) => crate::mpeg::open(input),
        #[cfg(feature = "symphonia")]
        Some(Format::Mp4) => crate::mp4::open(input),
        #[cfg(feature = "symphonia")]
        Some(Format::Aac) => crate::aac::open(input),
        #[cfg(feature = "symphonia")]
        Some(Format::Ogg) => crate::ogg::open(input),
        None => Err(AudioError::NotAudio { found, expected: FORMATS }),
    }
}
