//! Tags that stand before, between and after the audio of any format: ID3v2, ID3v1, APEv2.

use crate::error::AudioError;
use crate::input::Input;

/// Bytes that [`length`] looks at.
const SHOWN: usize = 32;

/// Whether a tag starts here.
pub(crate) fn starts(bytes: &[u8]) -> bool {
    length(bytes).is_some()
}

/// Bytes of the tag that starts here.
fn length(bytes: &[u8]) -> Option<u64> {
    match bytes {
        // ID3v2: version, flags, then the size in 4 times 7 bits; flag 0x10: a footer of 10 bytes.
        [b'I', b'D', b'3', version, _, flags, a, b, c, d, ..]
            if *version < 0xff && [a, b, c, d].iter().all(|n| **n < 0x80) =>
        {
            let size = [a, b, c, d].iter().fold(0, |n, byte| n << 7 | u64::from(**byte));
            Some(10 + size + if flags & 0x10 != 0 { 10 } else { 0 })
        }
        [b'T', b'A', b'G', b'+', ..] => Some(227),
        [b'T', b'A', b'G', ..] => Some(128),
        // APEv2: version, size of items and footer; the flag says that a header comes first.
        [b'A', b'P', b'E', b'T', b'A', b'G', b'E', b'X', rest @ ..] => {
            let size = u32::from_le_bytes(*rest.get(4..)?.first_chunk()?);
            let flags = u32::from_le_bytes(*rest.get(12..)?.first_chunk()?);
            let is_header = flags & 1 << 29 != 0;
            Some(if is_header { 32 + u64::from(size) } else { 32 })
        }
        _ => None,
    }
}

/// Passes over the tags that come next. A tag that reaches beyond the end of the file is not
/// believed: only its first bytes are passed.
pub(crate) fn skip(input: &mut Input) -> Result<(), AudioError> {
    loop {
        let Some(length) = length(input.peek(SHOWN)?) else {
            return Ok(());
        };
        if !input.pass(length)? {
            let first = input.peek(3)?.len().min(3);
            input.consume(first);
            return Ok(());
        }
    }
}
