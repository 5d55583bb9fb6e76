//! Boxes of ISO 14496-12 and QuickTime: a size, a type, a body that may hold other boxes.

use crate::error::AudioError;
use crate::input::Input;

/// Bytes that [`Head::parse`] looks at.
pub(super) const SHOWN: usize = 16;
/// Bytes read of a body at a time, so that memory grows with what is there.
const STEP: usize = 1 << 20;

/// The start of a box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Head {
    pub(super) kind: [u8; 4],
    /// Bytes before the body.
    pub(super) length: u64,
    /// Bytes of the body; `None`: up to the end of the file.
    pub(super) body: Option<u64>,
}

impl Head {
    /// ```text
    /// 0 u32 size of the whole box; 1: it stands at 8 as u64; 0: up to the end   4 type
    /// ```
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let size = u64::from(u32_at(bytes, 0)?);
        let kind = *bytes.get(4..8)?.first_chunk()?;
        let (length, size) = match size {
            0 => return Some(Self { kind, length: 8, body: None }),
            1 => (16, u64::from_be_bytes(*bytes.get(8..16)?.first_chunk()?)),
            size => (8, size),
        };
        Some(Self { kind, length, body: Some(size.checked_sub(length)?) })
    }

    /// Bytes of the whole box.
    pub(super) fn size(&self) -> Option<u64> {
        self.body?.checked_add(self.length)
    }
}

/// The boxes in a body, one that reaches beyond it with what is there.
pub(super) fn children(mut body: &[u8]) -> impl Iterator<Item = ([u8; 4], &[u8])> {
    std::iter::from_fn(move || {
        let head = Head::parse(body)?;
        let inside = body.get(head.length as usize..)?;
        let size = head.body.and_then(|n| usize::try_from(n).ok()).unwrap_or(usize::MAX);
        let (child, rest) = inside.split_at(size.min(inside.len()));
        body = rest;
        Some((head.kind, child))
    })
}

/// The first box of a type.
pub(super) fn child<'a>(body: &'a [u8], kind: &[u8; 4]) -> Option<&'a [u8]> {
    children(body).find(|(found, _)| found == kind).map(|(_, body)| body)
}

/// The box at the end of a path of types.
pub(super) fn descend<'a>(body: &'a [u8], path: &[&[u8; 4]]) -> Option<&'a [u8]> {
    path.iter().try_fold(body, |body, kind| child(body, kind))
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(*bytes.get(at..)?.first_chunk()?))
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_be_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// Takes the next `size` bytes; fewer where the input ends.
pub(super) fn take(input: &mut Input, size: usize) -> Result<Vec<u8>, AudioError> {
    let mut bytes = Vec::new();
    while bytes.len() < size {
        let shown = input.peek((size - bytes.len()).min(STEP))?;
        let n = shown.len().min(size - bytes.len());
        if n == 0 {
            break;
        }
        bytes.extend_from_slice(&shown[..n]);
        input.consume(n);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_boxes_are_claims() {
        let head = |bytes: &[u8]| Head::parse(bytes).map(|h| (h.length, h.body));
        assert_eq!(head(b"\0\0\0\x0cfree"), Some((8, Some(4))));
        assert_eq!(head(b"\0\0\0\x01mdat\0\0\0\x01\0\0\0\0"), Some((16, Some((1 << 32) - 16))));
        assert_eq!(head(b"\0\0\0\0mdat"), Some((8, None)));
        for bytes in [&b"\0\0\0\x07free"[..], b"\0\0\0\x01mdat\0\0\0\0\0\0\0\x0f", b"\0\0\0\x0cfre"]
        {
            assert_eq!(head(bytes), None);
        }
        let body = b"\0\0\0\x0aaaaa12\0\0\0\x08bbbb\xff\xff\xff\xffcccc345";
        let found: Vec<_> = children(body).collect();
        assert_eq!(found, [(*b"aaaa", &b"12"[..]), (*b"bbbb", b""), (*b"cccc", b"345")]);
        assert_eq!(child(body, b"cccc"), Some(&b"345"[..]));
        assert_eq!(children(b"\0\0\0\x02aaaa").count(), 0);
    }
}
