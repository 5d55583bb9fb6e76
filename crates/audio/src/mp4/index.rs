//! Where the index of a file is, before or after its packets.

use super::boxes::{self, Head};
use crate::error::AudioError;
use crate::input::Input;

/// Largest index (`moov`) that is read.
const MAX_MOOV: u64 = 64 << 20;
/// What of a pipe is held at most where its packets stand before their index.
const MOST_HELD: usize = 64 << 20;
/// Files with more boxes before their index are hostile.
const MAX_BOXES: usize = 4096;

/// Whether packets stand before their index in the first bytes of a file.
pub(super) fn data_come_first(mut shown: &[u8]) -> bool {
    while let Some(head) = Head::parse(shown) {
        match &head.kind {
            b"mdat" => return true,
            b"moov" => return false,
            _ => {}
        }
        let next = head.size().and_then(|size| shown.get(usize::try_from(size).ok()?..));
        let Some(next) = next else { return false };
        shown = next;
    }
    false
}

/// Keeps the rest of a pipe, so that it can be gone through in any order.
pub(super) fn hold(input: &mut Input) -> Result<(), AudioError> {
    let at = input.position();
    if input.hold(MOST_HELD)? {
        return Ok(());
    }
    let actual = format!(
        "MP4 in a pipe with more than {} MiB of packets before their index or out of order",
        MOST_HELD >> 20
    );
    Err(AudioError::unsupported(at, actual, "a file, or the index first (-movflags +faststart)"))
}

/// Reads the index, and goes to the box after it. Also gives the first byte at which packets can be
/// that are of use: after the index, unless packets stand before it.
pub(super) fn index(input: &mut Input) -> Result<(Vec<u8>, u64), AudioError> {
    let base = input.position();
    let mut has_data = false;
    for _ in 0..MAX_BOXES {
        let at = input.position();
        let Some(head) = Head::parse(input.peek(boxes::SHOWN)?) else { break };
        if &head.kind == b"moov" {
            let size = head.body.unwrap_or(MAX_MOOV);
            if size > MAX_MOOV {
                let actual = format!("an index (moov) of {size} bytes");
                return Err(AudioError::unsupported(at, actual, "at most 64 MiB"));
            }
            input.consume(head.length as usize);
            let moov = boxes::take(input, size as usize)?;
            if (moov.len() as u64) < size && head.body.is_some() {
                let actual = format!("{} of {size} bytes of the index (moov)", moov.len());
                return Err(AudioError::corrupt(at, actual, "a whole index"));
            }
            let floor = if has_data { base } else { input.position() };
            return Ok((moov, floor));
        }
        has_data |= &head.kind == b"mdat";
        if has_data && input.len().is_none() {
            let actual = "MP4 in a pipe with 64 KiB before packets that come before their index";
            let expected = "a file, or the index first (-movflags +faststart)";
            return Err(AudioError::unsupported(at, actual, expected));
        }
        let Some(size) = head.size() else { break };
        if !input.skip(size)? {
            break;
        }
    }
    let actual = if has_data {
        "MP4 without its index (moov), which a recorder writes last: it was stopped, or the file is cut off"
    } else {
        "MP4 without an index (moov)"
    };
    Err(AudioError::corrupt(base, actual, "boxes moov and mdat"))
}
