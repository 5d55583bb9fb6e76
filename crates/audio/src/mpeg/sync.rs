//! Where frames begin: in front of, between and after what is not audio.

use super::header::{HEADER, Header, MAX_FRAME};
use crate::tags;

/// Frames that must follow each other for the first one to be believed.
pub(super) const CHAIN: usize = 3;
/// Bytes that show such a chain wherever it begins in the first half of them.
pub(crate) const WINDOW: usize = 2 * (CHAIN + 1) * MAX_FRAME;

/// Whether frames follow each other from byte `at` on: [`CHAIN`] of them, or at least `least` up to
/// the end of the file (`is_end`: the buffer holds it) or to a tag. Those of free format have `free`
/// bytes.
fn is_chain(buffer: &[u8], at: usize, is_end: bool, least: usize, free: usize) -> bool {
    let parse = |bytes: &[u8]| Header::parse(bytes).map(|header| header.sized(free));
    let Some(first) = buffer.get(at..).and_then(parse).filter(|h| h.size > HEADER) else {
        return false;
    };
    let (mut at, mut count) = (at + first.size, 1);
    while count < CHAIN {
        let Some(rest) = buffer.get(at..) else {
            // Cut off inside the last frame.
            return is_end && count > least;
        };
        if rest.len() < HEADER || tags::starts(rest) {
            return (is_end || rest.len() >= HEADER) && count >= least;
        }
        match parse(rest).filter(|h| h.continues(&first)) {
            Some(header) => at += header.size,
            None => return false,
        }
        count += 1;
    }
    true
}

/// The first byte of `buffer` at which a chain of frames begins, of at least `least` frames where it
/// ends with the file.
pub(crate) fn find(buffer: &[u8], is_end: bool, least: usize) -> Option<usize> {
    find_where(buffer, is_end, least, 0, |_| true)
}

/// As [`find`], of frames with such a header; those of free format have `free` bytes.
pub(super) fn find_where(
    buffer: &[u8],
    is_end: bool,
    least: usize,
    free: usize,
    admits: impl Fn(&Header) -> bool,
) -> Option<usize> {
    let last = if is_end { buffer.len() } else { buffer.len().saturating_sub(WINDOW / 2) };
    (0..last).find(|&at| {
        buffer[at] == 0xff
            && Header::parse(&buffer[at..]).is_some_and(|header| admits(&header.sized(free)))
            && is_chain(buffer, at, is_end, least, free)
    })
}

/// Bytes without padding of the frames of free format that begin with `buffer`: their headers are
/// alike, and as far from each other as their padding says.
pub(crate) fn free_size(buffer: &[u8]) -> Option<usize> {
    let first = Header::parse(buffer).filter(|h| h.is_free)?;
    let next = |at: usize| {
        buffer.get(at..).and_then(Header::parse).filter(|header| header.continues(&first))
    };
    (HEADER + 1..MAX_FREE).find(|&plain| {
        let mut at = first.sized(plain).size;
        (1..CHAIN).all(|_| match next(at) {
            Some(header) => {
                at += header.sized(plain).size;
                true
            }
            None => false,
        })
    })
}

/// The first byte of `buffer` at which frames of free format begin. Behind other bytes, frames that are
/// all the same are none: samples of a periodic signal look like that.
pub(crate) fn find_free(buffer: &[u8]) -> Option<usize> {
    let (at, plain) = find_free_where(buffer, |_| true)?;
    let mut frames = buffer[at..].chunks_exact(plain);
    let is_repeated = frames.next().zip(frames.next()).is_some_and(|(one, next)| one == next);
    (at == 0 || !is_repeated).then_some(at)
}

fn find_free_where(buffer: &[u8], admits: impl Fn(&Header) -> bool) -> Option<(usize, usize)> {
    (0..buffer.len().min(WINDOW / 2)).filter(|at| buffer[*at] == 0xff).find_map(|at| {
        Header::parse(&buffer[at..]).filter(|header| header.is_free && admits(header))?;
        Some((at, free_size(&buffer[at..])?))
    })
}

/// Where frames begin that continue those of `first` but for their format: free with another size
/// than `free`, or standard after free. With the size of frames of free format from there on, or 0.
pub(super) fn find_other_format(
    buffer: &[u8],
    is_end: bool,
    first: &Header,
    free: usize,
) -> Option<(usize, usize)> {
    let other = find_free_where(buffer, |header| header.is_alike(first));
    let other = other.filter(|(_, size)| *size != free);
    if !first.is_free {
        return other;
    }
    let standard = |header: &Header| !header.is_free && header.is_alike(first);
    let standard = find_where(buffer, is_end, 1, 0, standard).map(|at| (at, 0));
    [other, standard].into_iter().flatten().min()
}

/// Frames of free format are not larger in practice: 640 kbit/s at 32 kHz.
const MAX_FREE: usize = 2880;
