//! H.264 by Cisco's OpenH264.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use openh264::OpenH264API;
use openh264::decoder::{DecodedYUV, Decoder, DecoderConfig, Flush};
use openh264::formats::YUVSource;

use super::colours::Colours;
use super::mp4::Track;
use crate::error::{Result, VisionError};
use crate::image::{Rgb, check_size};

/// What begins a unit of a stream.
const START: [u8; 4] = [0, 0, 0, 1];

/// A decoder that goes through a video.
pub(super) struct Decoding<'v> {
    track: &'v Track,
    path: &'v Path,
    file: File,
    decoder: Decoder,
    /// What is known of its colours.
    colours: Colours,
    /// Bytes of the length before each unit of a frame.
    length: usize,
    /// Parameter sets at first; then what is decoded.
    stream: Vec<u8>,
    /// Frames that have been given to the decoder.
    given: usize,
    /// Frames that it has given back.
    shown: u32,
    /// Those that it held back until the end.
    last: Option<VecDeque<(u32, Option<Rgb>)>>,
}

impl<'v> Decoding<'v> {
    /// Before the first frame.
    pub(super) fn begin(track: &'v Track, path: &'v Path) -> Result<Self> {
        let damaged = |reason: String| VisionError::file(path, reason);
        let setup = track.setup.as_deref().ok_or_else(|| {
            let codec = track.codec.escape_ascii();
            damaged(format!(
                "its codec is {codec}; only H.264 (avc1) videos are read: extract the frames as \
                 PNG or JPEG (docs/vision.md)"
            ))
        })?;
        let setup = setup_of(setup).ok_or_else(|| damaged("a damaged box avcC".into()))?;
        let Setup { units, length } = setup;
        let (mut colours, mut stream) = (Colours::new(track.declared), Vec::new());
        append(&units, &mut stream, &mut colours).map_err(damaged)?;
        // Frames come in the order in which they are shown only where none is asked for before its turn.
        let config = DecoderConfig::new().flush_after_decode(Flush::NoFlush);
        let decoder = Decoder::with_api_config(OpenH264API::from_source(), config);
        let decoder = decoder.map_err(|e| damaged(format!("no decoder: {e}")))?;
        let file = File::open(path).map_err(|e| VisionError::io(path, e))?;
        let (given, shown, last) = (0, 0, None);
        Ok(Self { track, path, file, decoder, colours, length, stream, given, shown, last })
    }

    /// As [`super::Pictures::next`].
    pub(super) fn next(
        &mut self,
        wanted: &dyn Fn(u32) -> bool,
    ) -> Result<Option<(u32, Option<Rgb>)>> {
        while self.given < self.track.frames.len() {
            if let Some(found) = self.decode(wanted)? {
                return Ok(Some(found));
            }
        }
        if self.last.is_none() {
            self.last = Some(self.flush(wanted)?);
        }
        if let Some(found) = self.last.as_mut().and_then(VecDeque::pop_front) {
            return Ok(Some(found));
        }
        match self.shown as usize == self.track.frames.len() {
            true => Ok(None),
            false => {
                let (shown, count) = (self.shown, self.track.frames.len());
                Err(self.damaged(format!("{shown} of {count} frames can be decoded")))
            }
        }
    }

    /// Gives a frame to the decoder; what it gives back.
    fn decode(&mut self, wanted: &dyn Fn(u32) -> bool) -> Result<Option<(u32, Option<Rgb>)>> {
        let (number, path) = (self.given, self.path);
        let (at, bytes) = self.track.frames[number];
        let io = |e| VisionError::io(path, e);
        let mut frame = Vec::new();
        self.file.seek(SeekFrom::Start(at)).map_err(io)?;
        self.file.by_ref().take(bytes.into()).read_to_end(&mut frame).map_err(io)?;
        let units = units(&frame, self.length)
            .ok_or_else(|| self.damaged(format!("frame {number} is damaged")))?;
        append(&units, &mut self.stream, &mut self.colours)
            .map_err(|reason| VisionError::file(path, reason))?;
        self.given += 1;
        let Self { decoder, colours, stream, shown, .. } = self;
        let found = guarded(|| match decoder.decode(stream) {
            Ok(Some(yuv)) => Some(converted(&yuv, shown, wanted, (colours, path))).transpose(),
            Ok(None) => Ok(None),
            Err(error) => {
                let reason = match colours.foreign() {
                    Some(foreign) => format!(
                        "it has {foreign}, which OpenH264 does not decode: extract the frames as PNG or JPEG \
                         (docs/vision.md)"
                    ),
                    None => format!("frame {number} cannot be decoded: {error}"),
                };
                Err(VisionError::file(path, reason))
            }
        });
        self.stream.clear();
        found.ok_or_else(|| self.damaged(format!("the decoder failed on frame {number}")))?
    }

    /// What the decoder still holds after the last frame.
    fn flush(&mut self, wanted: &dyn Fn(u32) -> bool) -> Result<VecDeque<(u32, Option<Rgb>)>> {
        let Self { decoder, colours, shown, path, .. } = self;
        let left = guarded(|| {
            let left = decoder.flush_remaining().map_err(|e| {
                VisionError::file(path, format!("its last frames cannot be decoded: {e}"))
            })?;
            left.iter().map(|yuv| converted(yuv, shown, wanted, (colours, path))).collect()
        });
        left.ok_or_else(|| self.damaged("the decoder failed on its last frames".into()))?
    }

    fn damaged(&self, reason: String) -> VisionError {
        VisionError::file(self.path, reason)
    }
}

/// A frame with the next number, and its picture where that is wanted.
fn converted(
    yuv: &DecodedYUV<'_>,
    shown: &mut u32,
    wanted: &dyn Fn(u32) -> bool,
    (colours, path): (&Colours, &Path),
) -> Result<(u32, Option<Rgb>)> {
    let number = *shown;
    *shown += 1;
    Ok((number, if wanted(number) { Some(rgb(yuv, colours, path)?) } else { None }))
}

/// Runs foreign code; `None` where it panics.
fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(decode)).ok()
}

/// What a decoder must know first.
struct Setup<'a> {
    /// Parameter sets.
    units: Vec<&'a [u8]>,
    /// Bytes of the length before each unit of a frame.
    length: usize,
}

fn setup_of(bytes: &[u8]) -> Option<Setup<'_>> {
    let length = usize::from(bytes.get(4)? & 3) + 1;
    let (mut units, mut at) = (Vec::new(), 5);
    for mask in [0x1f, 0xff] {
        let count = bytes.get(at)? & mask;
        at += 1;
        for _ in 0..count {
            let size = usize::from(u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?));
            units.push(bytes.get(at + 2..)?.get(..size)?);
            at += 2 + size;
        }
    }
    Some(Setup { units, length })
}

/// The units of a frame.
fn units(mut frame: &[u8], length: usize) -> Option<Vec<&[u8]>> {
    let mut units = Vec::new();
    while !frame.is_empty() {
        let size = frame.get(..length)?.iter().fold(0, |size, &byte| size << 8 | usize::from(byte));
        units.push(frame[length..].get(..size)?);
        frame = &frame[length + size..];
    }
    Some(units)
}

/// Adds units to a stream, and what they say of colours.
fn append(
    units: &[&[u8]],
    stream: &mut Vec<u8>,
    colours: &mut Colours,
) -> std::result::Result<(), String> {
    for unit in units {
        colours.read(unit)?;
        stream.extend(START);
        stream.extend(*unit);
    }
    Ok(())
}

fn rgb(yuv: &DecodedYUV<'_>, colours: &Colours, path: &Path) -> Result<Rgb> {
    let (width, height) = yuv.dimensions();
    check_size(width, height, path)?;
    let conversion = colours.conversion().map_err(|reason| VisionError::file(path, reason))?;
    let mut data = vec![0; 3 * width * height];
    let strides = yuv.strides();
    // The decoder leaves the colours of grey frames unset.
    let neutral = vec![128; width.div_ceil(2)];
    let planes = match colours.is_grey() {
        true => [(yuv.y(), strides.0), (&neutral[..], 0), (&neutral[..], 0)],
        false => [(yuv.y(), strides.0), (yuv.u(), strides.1), (yuv.v(), strides.2)],
    };
    conversion.write(planes, width, &mut data);
    Ok(Rgb { width, height, data })
}
