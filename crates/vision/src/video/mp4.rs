//! Where the frames of a video lie in an MP4 file.
//!
//! Of ISO 14496-12 only what that takes is read. The crate `re_mp4` makes as many frames as a header claims, and
//! does not end on a box of size 0 in another.

use std::io::{Read, Seek, SeekFrom};

/// Largest index that is read.
const MAX_INDEX: u64 = 64 << 20;
/// Boxes beside it, of which a file has a handful.
const MAX_BOXES: usize = 10_000;
/// Most frames of a video: 55 minutes at 30 a second.
pub(crate) const MAX_FRAMES: usize = 100_000;
/// Largest frame before it is decoded.
const MAX_FRAME: u32 = 32 << 20;
/// Said of a file whose frames are not all in its index.
const FRAGMENTED: &str = "it is fragmented; `ffmpeg -i IN -c copy OUT.mp4` makes one that is not";
/// Said of a file whose edit list leaves something out.
const EDITED: &str = "`ffmpeg -i IN OUT.mp4` makes a file with only what is shown";
/// What comes before the boxes of a `VisualSampleEntry`.
const VISUAL_ENTRY: usize = 78;

/// The video track.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "video"), expect(dead_code, reason = "what decoding needs"))]
pub(super) struct Track {
    /// Codec, such as `avc1`.
    pub(super) codec: [u8; 4],
    /// Content of its `avcC` box; `None` for other codecs.
    pub(super) setup: Option<Vec<u8>>,
    /// Its colours, as far as the file says.
    pub(super) declared: Declared,
    /// First byte and number of bytes of each frame, in decoding order.
    pub(super) frames: Vec<(u64, u32)>,
    /// Whether frames are stored in another order than they are shown in.
    pub(super) reordered: bool,
}

/// What is said of colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Declared {
    /// Number of the matrix in ITU-T H.273.
    pub(super) matrix: Option<u16>,
    /// Whether numbers take the full range of 8 bits.
    pub(super) full: Option<bool>,
}

/// A box: what it is, and its content.
type Boxed<'a> = ([u8; 4], &'a [u8]);

/// The first video track of a file of `size` bytes.
pub(super) fn read(file: &mut (impl Read + Seek), size: u64) -> Result<Track, String> {
    let index = index(file, size)?;
    if child(&index, b"mvex").is_ok() {
        return Err(FRAGMENTED.into());
    }
    for (kind, track) in children(&index)? {
        if kind != *b"trak" {
            continue;
        }
        let media = child(track, b"mdia")?;
        // Version, flags, a reserved number; then what handles the media.
        if child(media, b"hdlr")?.get(8..12) == Some(b"vide") {
            upright(child(track, b"tkhd")?)?;
            let table = child(child(media, b"minf")?, b"stbl")?;
            let found = self::track(table, size)?;
            let edits = child(track, b"edts").and_then(|edits| child(edits, b"elst"));
            if let Ok(edits) = edits {
                let timescale = |header: &[u8]| {
                    u32_at(header, if header.first() == Some(&1) { 20 } else { 12 })
                };
                let movie = timescale(child(&index, b"mvhd")?)?;
                let media = timescale(child(media, b"mdhd")?)?;
                whole(edits, &shown(table, found.frames.len())?, (movie, media))?;
            }
            return Ok(found);
        }
    }
    Err("it has no video track".into())
}

/// The content of `moov`.
fn index(file: &mut (impl Read + Seek), size: u64) -> Result<Vec<u8>, String> {
    let mut at = 0;
    for _ in 0..MAX_BOXES {
        let mut head = [0; 16];
        let length = (size.saturating_sub(at)).min(16) as usize;
        if length < 8 {
            break;
        }
        file.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
        file.read_exact(&mut head[..length]).map_err(|e| e.to_string())?;
        let kind = [head[4], head[5], head[6], head[7]];
        if at == 0 && !kind.iter().all(|c| c.is_ascii_graphic() || *c == b' ') {
            return Err("it does not begin with a box".into());
        }
        let (header, bytes) = match u32_at(&head, 0)? {
            // To the end of the file.
            0 => (8, size - at),
            1 if length == 16 => (16, u64_at(&head, 8)?),
            bytes => (8, u64::from(bytes)),
        };
        let end = at.checked_add(bytes).filter(|end| bytes >= header && *end <= size);
        let name = || kind.escape_ascii();
        let end = end.ok_or_else(|| format!("box {} at byte {at} leaves the file", name()))?;
        match &kind {
            b"moof" => return Err(FRAGMENTED.into()),
            b"moov" if bytes > MAX_INDEX => {
                return Err(format!("an index of {bytes} bytes; the limit is {MAX_INDEX}"));
            }
            b"moov" => {
                file.seek(SeekFrom::Start(at + header)).map_err(|e| e.to_string())?;
                let mut content = Vec::new();
                file.take(bytes - header).read_to_end(&mut content).map_err(|e| e.to_string())?;
                return Ok(content);
            }
            _ => at = end,
        }
    }
    Err("it has no index (moov): perhaps its recording was interrupted".into())
}

/// Refuses pictures that are to be turned: frames that others extracted are.
fn upright(header: &[u8]) -> Result<(), String> {
    const UPRIGHT: [u32; 9] = [1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30];
    let at = if header.first() == Some(&1) { 52 } else { 40 };
    let same = (0..9).all(|i| u32_at(header, at + 4 * i) == Ok(UPRIGHT[i]));
    if same { Ok(()) } else { Err("its pictures are rotated (tkhd)".into()) }
}

/// When each frame is shown, in units of the media.
fn shown(table: &[u8], count: usize) -> Result<Vec<i64>, String> {
    let mut times = Vec::with_capacity(count);
    let mut at = 0i64;
    for run in entries(child(table, b"stts")?, 8)? {
        let (frames, step) = (u32_at(run, 0)? as usize, i64::from(u32_at(run, 4)?));
        for _ in 0..frames.min(count - times.len()) {
            times.push(at);
            at += step;
        }
    }
    if times.len() != count {
        return Err(format!("its index says when {} of {count} frames are shown", times.len()));
    }
    if let Ok(later) = child(table, b"ctts") {
        let mut frame = 0;
        for run in entries(later, 8)? {
            let frames = (u32_at(run, 0)? as usize).min(count - frame);
            let by = u32_at(run, 4)? as i32;
            times[frame..frame + frames].iter_mut().for_each(|time| *time += i64::from(by));
            frame += frames;
        }
    }
    Ok(times)
}

/// Whether the frames of these delays come by different ones.
fn varies(later: &[u8]) -> bool {
    let Ok(runs) = entries(later, 8) else { return false };
    let mut delays = runs.map(|run| u32_at(run, 4).ok());
    let first = delays.next();
    delays.any(|delay| Some(delay) != first)
}

/// Refuses an edit list that leaves frames out: players do not show them, and they have no number.
fn whole(edits: &[u8], times: &[i64], (movie, media): (u32, u32)) -> Result<(), String> {
    let long = edits.first() == Some(&1);
    let width = if long { 20 } else { 12 };
    let mut parts = Vec::new();
    for edit in entries(edits, width)? {
        let (length, start) = match long {
            true => (u64_at(edit, 0)?, u64_at(edit, 8)? as i64),
            false => (u64::from(u32_at(edit, 0)?), i64::from(u32_at(edit, 4)? as i32)),
        };
        // Nothing is shown for a while: no frame is left out.
        if start != -1 {
            parts.push((length, start));
        }
    }
    let (length, start) = match parts[..] {
        [] => return Ok(()),
        [part] => part,
        _ => return Err(format!("its edit list has {} parts; {EDITED}", parts.len())),
    };
    let end = u128::from(length) * u128::from(media) / u128::from(movie.max(1));
    // A length of 0 is that of the media.
    let end = if length == 0 { i128::MAX } else { i128::from(start) + end as i128 };
    let hidden = times.iter().filter(|&&t| t < start || i128::from(t) >= end).count();
    match hidden {
        0 => Ok(()),
        _ => Err(format!("its edit list leaves out {hidden} of {} frames; {EDITED}", times.len())),
    }
}

/// The frames of a table of samples, in a file of `size` bytes.
fn track(table: &[u8], size: u64) -> Result<Track, String> {
    let descriptions = child(table, b"stsd")?.get(8..).unwrap_or_default();
    let (codec, entry) = match children(descriptions)?[..] {
        [only] => only,
        ref all => {
            return Err(format!(
                "{} descriptions of its video, but only one can be read",
                all.len()
            ));
        }
    };
    let more = entry.get(VISUAL_ENTRY..).unwrap_or_default();
    let (setup, declared) = match codec == *b"avc1" || codec == *b"avc3" {
        true => (Some(child(more, b"avcC")?.to_vec()), colours(more)),
        false => (None, Declared::default()),
    };
    let sizes = child(table, b"stsz")?;
    let (every, count) = (u32_at(sizes, 4)?, u32_at(sizes, 8)? as usize);
    if count > MAX_FRAMES {
        return Err(format!("{count} frames; the limit is {MAX_FRAMES}"));
    }
    // No more chunks than frames are of use.
    let chunks: Vec<u64> = match child(table, b"stco") {
        Ok(offsets) => {
            let offsets = entries(offsets, 4)?.take(count);
            offsets.map(|e| u32_at(e, 0).map(u64::from)).collect::<Result<_, _>>()?
        }
        Err(_) => {
            let offsets = entries(child(table, b"co64")?, 8)?.take(count);
            offsets.map(|e| u64_at(e, 0)).collect::<Result<_, _>>()?
        }
    };
    let mut runs = entries(child(table, b"stsc")?, 12)?.peekable();
    let (mut frames, mut in_chunk, mut all) = (Vec::with_capacity(count), 0, 0);
    for (number, &chunk) in (1u32..).zip(&chunks) {
        while let Some(run) = runs.next_if(|run| u32_at(run, 0).is_ok_and(|first| first <= number))
        {
            in_chunk = u32_at(run, 4)?;
        }
        let mut at = chunk;
        for _ in 0..in_chunk {
            let frame = frames.len();
            if frame == count {
                break;
            }
            let bytes = match every {
                0 => u32_at(sizes, 12 + 4 * frame)?,
                every => every,
            };
            let end = at.checked_add(bytes.into()).filter(|end| *end <= size);
            let end = end.ok_or_else(|| format!("it ends before frame {frame}"))?;
            if bytes > MAX_FRAME {
                return Err(format!("frame {frame} has {bytes} bytes; the limit is {MAX_FRAME}"));
            }
            // Frames that lie in each other would be read again and again.
            all += u64::from(bytes);
            if all > size {
                return Err("its frames have more bytes than the file".into());
            }
            frames.push((at, bytes));
            at = end;
        }
    }
    match frames.len() == count {
        true => {
            let reordered = child(table, b"ctts").is_ok_and(varies);
            Ok(Track { codec, setup, declared, frames, reordered })
        }
        false => Err(format!("its index locates {} of {count} frames", frames.len())),
    }
}

/// What the boxes of a description say of colours: numbers of primaries, transfer and matrix, and of ISO's kind the
/// range.
fn colours(description: &[u8]) -> Declared {
    let Ok(said) = child(description, b"colr") else { return Declared::default() };
    let kind = said.get(..4).unwrap_or_default();
    if kind != b"nclx" && kind != b"nclc" {
        return Declared::default();
    }
    let matrix = said.get(8..10).and_then(|two| two.first_chunk());
    let full = said.get(10).filter(|_| kind == b"nclx").map(|byte| byte & 0x80 > 0);
    Declared { matrix: matrix.map(|two| u16::from_be_bytes(*two)), full }
}

/// The entries of a table of `width` bytes each, after version, flags and their number.
fn entries(table: &[u8], width: usize) -> Result<std::slice::ChunksExact<'_, u8>, String> {
    let count = u32_at(table, 4)? as usize;
    let bytes = count.checked_mul(width).and_then(|bytes| table.get(8..)?.get(..bytes));
    let bytes = bytes.ok_or_else(|| format!("a table of {count} entries ends too early"))?;
    Ok(bytes.chunks_exact(width))
}

/// The boxes in a box.
fn children(mut bytes: &[u8]) -> Result<Vec<Boxed<'_>>, String> {
    let mut found = Vec::new();
    while bytes.len() >= 8 && found.len() < MAX_BOXES {
        let size = u32_at(bytes, 0)? as usize;
        let kind = [bytes[4], bytes[5], bytes[6], bytes[7]];
        let content = bytes.get(8..size).ok_or_else(|| {
            format!(
                "box {} has {size} bytes in a box with {} left",
                kind.escape_ascii(),
                bytes.len()
            )
        })?;
        found.push((kind, content));
        bytes = &bytes[size..];
    }
    Ok(found)
}

/// The first box of a kind in a box.
fn child<'a>(bytes: &'a [u8], kind: &[u8; 4]) -> Result<&'a [u8], String> {
    let found = children(bytes)?.into_iter().find(|(k, _)| k == kind);
    found.map(|(_, content)| content).ok_or_else(|| format!("no box {}", kind.escape_ascii()))
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u32, String> {
    let number = bytes.get(at..).and_then(<[u8]>::first_chunk);
    number.map(|n| u32::from_be_bytes(*n)).ok_or_else(|| "a table ends too early".into())
}

fn u64_at(bytes: &[u8], at: usize) -> Result<u64, String> {
    let number = bytes.get(at..).and_then(<[u8]>::first_chunk);
    number.map(|n| u64::from_be_bytes(*n)).ok_or_else(|| "a table ends too early".into())
}
