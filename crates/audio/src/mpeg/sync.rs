//! Where frames begin: in front of, between and behind what is not audio.

use super::header::{HEADER, Header, MAX_FRAME};
use crate::tags;

/// Frames that must follow each other for the first one to be believed.
pub(super) const CHAIN: usize = 3;
/// Bytes that show such a chain wherever it begins in the first half of them.
pub(crate) const WINDOW: usize = 2 * (CHAIN + 1) * MAX_FRAME;

/// Whether frames follow each other from byte `at` on: [`CHAIN`] of them, or at least `least` up to
/// the end of the file (`is_end`: the buffer holds it) or to a tag.
fn is_chain(buffer: &[u8], at: usize, is_end: bool, least: usize) -> bool {
    let Some(first) = buffer.get(at..).and_then(Header::parse).filter(|h| h.size > HEADER) else {
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
        match Header::parse(rest).filter(|h| h.continues(&first)) {
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
    find_where(buffer, is_end, least, |_| true)
}

/// As [`find`], of frames with such a header.
pub(super) fn find_where(
    buffer: &[u8],
    is_end: bool,
    least: usize,
    admits: impl Fn(&Header) -> bool,
) -> Option<usize> {
    let last = if is_end { buffer.len() } else { buffer.len().saturating_sub(WINDOW / 2) };
    (0..last).find(|&at| {
        buffer[at] == 0xff
            && Header::parse(&buffer[at..]).is_some_and(|header| admits(&header))
            && is_chain(buffer, at, is_end, least)
    })
}

/// Whether frames of free format follow each other from the start of `buffer` on: their headers are
/// alike and equally far from each other.
pub(crate) fn is_free_format(buffer: &[u8]) -> bool {
    let Some(first) = Header::parse(buffer).filter(|h| h.bit_rate == 0) else {
        return false;
    };
    let is_next =
        |at: usize| buffer.get(at..).and_then(Header::parse).is_some_and(|h| h.continues(&first));
    // A padding byte makes every other frame longer by one.
    (HEADER..MAX_FREE).any(|size| {
        is_next(size) && [2 * size - 1, 2 * size, 2 * size + 1].into_iter().any(is_next)
    })
}

/// Frames of free format are not larger in practice: 640 kbit/s at 32 kHz.
const MAX_FREE: usize = 2880;
