//! WAV (RIFF, RIFX, RF64, BW64): finds `fmt ` and `data`, repairs what the policy allows.

use super::extent::{
    Extent, Sizes, beyond_end, is_no_size, is_placeholder, is_really_empty, to_end,
};
use super::format::{Endian, Format};
use super::header::Header;
use crate::error::AudioError;
use crate::input::Input;
use crate::report::Repair;

/// A file with more chunks before its data is hostile.
const MAX_CHUNKS: usize = 4096;

/// Data sizes of writers that could not know: SoX and arecord, into a pipe.
const STREAMED: [u64; 2] = [0x7fff_f000, 0x7fff_ff00];
/// What others put there: the largest number, perhaps without the 36 bytes before the data. Recordings that a
/// recorder has split are nearly as long.
const LARGEST: [u64; 3] = [0x7fff_ffff, 0x7fff_ffdb, 0xffff_ffdb];

/// Chunk names that decide whether an odd chunk was padded, where both readings are possible.
const KNOWN: [&[u8; 4]; 24] = [
    b"fmt ", b"data", b"fact", b"LIST", b"bext", b"iXML", b"JUNK", b"junk", b"PAD ", b"FLLR",
    b"smpl", b"inst", b"cue ", b"plst", b"PEAK", b"id3 ", b"ID3 ", b"_PMX", b"axml", b"chna",
    b"cart", b"acid", b"afsp", b"minf",
];

/// Whether a file that starts with these (up to 12) bytes is for this reader: a WAV, or cut off
/// before it can be anything else.
pub(crate) fn is_wav(start: &[u8]) -> bool {
    let form = matches!(start.get(..4), Some(b"RIFF" | b"RIFX" | b"RF64" | b"BW64"));
    form && start.get(8..).is_none_or(|kind| b"WAVE".starts_with(kind) || kind.starts_with(b"WAVE"))
}

/// Reads up to the first sample.
pub(super) fn read(input: &mut Input) -> Result<Header, AudioError> {
    let start = input.position();
    let Some(&[f0, f1, f2, f3, ..]) = input.peek(12)?.first_chunk::<12>() else {
        let actual = "the file ends inside the RIFF header";
        return Err(AudioError::corrupt(start, actual, "12 bytes: id, size, WAVE"));
    };
    let form = [f0, f1, f2, f3];
    input.consume(12);
    let endian = if &form == b"RIFX" { Endian::Big } else { Endian::Little };
    let mut format = None;
    let mut long_size = None;
    let mut repairs = Vec::new();
    for _ in 0..MAX_CHUNKS {
        let at = input.position();
        let Some(&[i0, i1, i2, i3, s0, s1, s2, s3]) = input.peek(8)?.first_chunk::<8>() else {
            let missing = if format.is_some() { "data" } else { "fmt" };
            return Err(AudioError::corrupt(
                at,
                format!("the file ends without a {missing} chunk"),
                "chunks fmt and data",
            ));
        };
        input.consume(8);
        let id = [i0, i1, i2, i3];
        let size = endian.u32([s0, s1, s2, s3]);
        if &id == b"data" {
            let Some(format) = format else {
                return Err(AudioError::corrupt(at, "data before fmt", "a fmt chunk first"));
            };
            return finish(input, form, endian, format, size, long_size, repairs);
        }
        let mut body = [0; 40];
        let shown = input.peek((size as usize).min(body.len()))?;
        let n = shown.len().min(body.len()).min(size as usize);
        body[..n].copy_from_slice(&shown[..n]);
        let body = &body[..n];
        skip_chunk(input, at, id, size, &mut repairs)?;
        match &id {
            b"fmt " => format = Some(Format::parse(body, endian, at + 8)?),
            b"ds64" => long_size = body.get(8..16).and_then(|b| b.try_into().ok()),
            _ => {}
        }
    }
    let at = input.position();
    Err(AudioError::corrupt(at, format!("{MAX_CHUNKS} chunks and no data"), "a data chunk"))
}

/// Decides how many bytes belong to the samples.
fn finish(
    input: &mut Input,
    form: [u8; 4],
    endian: Endian,
    format: Format,
    size: u32,
    long_size: Option<[u8; 8]>,
    mut repairs: Vec<Repair>,
) -> Result<Header, AudioError> {
    let available = input.len().map(|len| len.saturating_sub(input.position()));
    repairs.extend(format.repair);
    let mut declared = u64::from(size);
    let mut unknown = size == u32::MAX;
    if let (Some(long), u32::MAX) = (long_size, size) {
        declared = endian.u64(long);
        unknown = declared == u64::MAX;
    }
    let plain = matches!(&form, b"RIFF" | b"RIFX") && long_size.is_none();
    unknown |= plain && STREAMED.iter().any(|all| is_placeholder(input, &format, declared, *all));
    unknown |= plain && LARGEST.iter().any(|all| is_no_size(input, &format, declared, *all));
    if let (true, false, Some(there)) = (plain, unknown, available)
        && there.saturating_sub(declared) >= 1 << 32
    {
        // Only the low 32 bits of the size are left: the largest that fits in the file.
        let used = declared + ((there - declared) >> 32 << 32);
        repairs.push(Repair::DataSizeWrapped { declared, used });
        declared = used;
    }
    let empty = declared == 0 && is_really_empty(input, Sizes::Short(endian))?;
    let declared = match declared {
        _ if unknown => to_end(Repair::DataSizeUnknown, &mut repairs),
        0 if !empty => to_end(Repair::DataSizeZero, &mut repairs),
        declared => Some(declared),
    };
    let container = match &form {
        b"RF64" => "rf64",
        b"BW64" => "bw64",
        b"RIFX" => "rifx",
        _ => "wav",
    };
    let extent = Extent::new(input, &format, declared, &mut repairs);
    Ok(Header { container, format, endian, extent, repairs })
}

/// Leaves the chunk at byte `at`, whose body comes next, and its padding byte if it has one.
fn skip_chunk(
    input: &mut Input,
    at: u64,
    id: [u8; 4],
    size: u32,
    repairs: &mut Vec<Repair>,
) -> Result<(), AudioError> {
    if !input.skip(size.into())? {
        return Err(beyond_end(at, &id, size.into()));
    }
    if size % 2 == 1 {
        let next = input.peek(5)?;
        if next.first_chunk::<5>().is_some_and(is_unpadded) {
            repairs.push(Repair::MissingPadding { offset: input.position() });
        } else if !next.is_empty() {
            input.consume(1);
        }
    }
    Ok(())
}

/// Whether the chunk name starts right after an odd chunk rather than one byte later.
fn is_unpadded(next: &[u8; 5]) -> bool {
    let known = |id: &[u8]| KNOWN.iter().any(|k| *k == id);
    let printable = |id: &[u8]| id.iter().all(|b| (0x20..0x7f).contains(b));
    let (here, after) = (&next[..4], &next[1..]);
    !known(after) && (known(here) || (printable(here) && !printable(after)))
}

/// The byte at which more samples begin, in another data chunk or another WAV file; the input shows
/// the byte after the samples, `size` bytes of them.
pub(super) fn more_data(
    input: &mut Input,
    size: u64,
    endian: Endian,
) -> Result<Option<u64>, AudioError> {
    let is_padded = input.peek(5)?.first_chunk::<5>().is_some_and(|next| !is_unpadded(next));
    if size % 2 == 1 && is_padded {
        input.consume(1);
    }
    for _ in 0..MAX_CHUNKS {
        let at = input.position();
        let shown = input.peek(12)?;
        let Some(&[i0, i1, i2, i3, s0, s1, s2, s3, ..]) = shown.first_chunk::<12>() else { break };
        let (id, size) = ([i0, i1, i2, i3], endian.u32([s0, s1, s2, s3]));
        if (is_wav(shown) && shown[8..].starts_with(b"WAVE")) || (&id == b"data" && size > 0) {
            return Ok(Some(at));
        }
        let named = id.iter().all(|b| (0x20..0x7f).contains(b));
        if !named || !input.skip(8 + u64::from(size) + u64::from(size % 2))? {
            break;
        }
    }
    Ok(None)
}
