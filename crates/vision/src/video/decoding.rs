//! H.264 by Cisco's OpenH264.

use std::io::{Read, Seek, SeekFrom};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use openh264::OpenH264API;
use openh264::decoder::{DecodedYUV, Decoder, DecoderConfig, Flush};
use openh264::formats::YUVSource;

use super::mp4::Track;
use crate::error::{Result, VisionError};
use crate::image::{Rgb, check_size};

/// What begins a unit of a stream.
const START: [u8; 4] = [0, 0, 0, 1];

/// As [`super::Video::pictures`].
pub(super) fn pictures(
    track: &Track,
    file: &mut (impl Read + Seek),
    path: &Path,
    wanted: impl Fn(u32) -> bool,
    mut each: impl FnMut(u32, Rgb) -> ControlFlow<()>,
) -> Result<()> {
    let damaged = |reason: String| VisionError::file(path, reason);
    if track.setup.is_empty() {
        let codec = track.codec.escape_ascii();
        return Err(damaged(format!(
            "its codec is {codec}; of videos H.264 (avc1) is read: extract the frames as PNG or JPEG \
             (docs/vision.md)"
        )));
    }
    // Frames come in the order in which they are shown only where none is asked for before its turn.
    let config = DecoderConfig::new().flush_after_decode(Flush::NoFlush);
    let decoder = Decoder::with_api_config(OpenH264API::from_source(), config);
    let mut decoder = decoder.map_err(|e| damaged(format!("no decoder: {e}")))?;
    let setup = setup(&track.setup).ok_or_else(|| damaged("a damaged box avcC".into()))?;
    let Setup { prefix, length } = setup;
    let mut shown = 0;
    let mut show = |picture: Option<Rgb>| {
        let number = shown;
        shown += 1;
        picture.map_or(ControlFlow::Continue(()), |picture| each(number, picture))
    };
    let mut next = 0;
    let mut convert = |yuv: &DecodedYUV<'_>| {
        let number = next;
        next += 1;
        if wanted(number) { rgb(yuv, path).map(Some) } else { Ok(None) }
    };
    let mut stream = prefix;
    for (number, &(at, bytes)) in track.frames.iter().enumerate() {
        let mut frame = Vec::new();
        file.seek(SeekFrom::Start(at)).map_err(|e| VisionError::io(path, e))?;
        file.take(bytes.into()).read_to_end(&mut frame).map_err(|e| VisionError::io(path, e))?;
        units(&frame, length, &mut stream)
            .ok_or_else(|| damaged(format!("frame {number} is damaged")))?;
        let found = guarded(|| match decoder.decode(&stream) {
            Ok(Some(yuv)) => convert(&yuv).map(Some),
            Ok(None) => Ok(None),
            Err(error) => Err(damaged(format!("frame {number} cannot be decoded: {error}"))),
        });
        let found =
            found.ok_or_else(|| damaged(format!("the decoder gave up on frame {number}")))?;
        if let Some(picture) = found?
            && show(picture).is_break()
        {
            return Ok(());
        }
        stream.clear();
    }
    let last = guarded(|| {
        let left = decoder.flush_remaining();
        let left = left.map_err(|e| damaged(format!("its last frames cannot be decoded: {e}")))?;
        left.iter().map(&mut convert).collect::<Result<Vec<_>>>()
    });
    for picture in
        last.ok_or_else(|| damaged("the decoder gave up on its last frames".into()))??
    {
        if show(picture).is_break() {
            return Ok(());
        }
    }
    match shown as usize == track.frames.len() {
        true => Ok(()),
        false => Err(damaged(format!("{shown} of {} frames can be decoded", track.frames.len()))),
    }
}

/// Runs foreign code; `None` where it panics.
fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(decode)).ok()
}

/// What a decoder must know first.
struct Setup {
    /// Parameter sets as a stream.
    prefix: Vec<u8>,
    /// Bytes of the length before each unit of a frame.
    length: usize,
}

fn setup(bytes: &[u8]) -> Option<Setup> {
    let length = usize::from(bytes.get(4)? & 3) + 1;
    let (mut prefix, mut at) = (Vec::new(), 5);
    for mask in [0x1f, 0xff] {
        let count = bytes.get(at)? & mask;
        at += 1;
        for _ in 0..count {
            let size = usize::from(u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?));
            prefix.extend(START);
            prefix.extend(bytes.get(at + 2..)?.get(..size)?);
            at += 2 + size;
        }
    }
    Some(Setup { prefix, length })
}

/// Adds the units of a frame to a stream.
fn units(mut frame: &[u8], length: usize, stream: &mut Vec<u8>) -> Option<()> {
    while !frame.is_empty() {
        let size = frame.get(..length)?.iter().fold(0, |size, &byte| size << 8 | usize::from(byte));
        stream.extend(START);
        stream.extend(frame[length..].get(..size)?);
        frame = &frame[length + size..];
    }
    Some(())
}

fn rgb(yuv: &DecodedYUV<'_>, path: &Path) -> Result<Rgb> {
    let (width, height) = yuv.dimensions();
    check_size(width, height, path)?;
    let mut data = vec![0; 3 * width * height];
    yuv.write_rgb8(&mut data);
    Ok(Rgb { width, height, data })
}
