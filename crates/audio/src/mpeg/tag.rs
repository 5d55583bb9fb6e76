//! The frame without audio that encoders put first: Xing or Info, with LAME's extension, or VBRI.

use super::header::{HEADER, Header};

/// Samples that a decoder of layer 3 puts before the encoder's own delay.
const DECODER_DELAY: u32 = 529;

/// What such a frame says about the recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Tag {
    /// Frames that follow, where it says so.
    pub(crate) frames: Option<u32>,
    /// Bytes from the frame of the tag to the end, where it says so; some writers do not count that frame.
    pub(crate) bytes: Option<u32>,
    /// Samples per channel to drop at the start and at the end.
    pub(crate) trim: (u32, u32),
}

impl Tag {
    /// Reads the tag in a frame; `None` where the frame is audio.
    pub(crate) fn parse(frame: &[u8], header: &Header) -> Option<Self> {
        if header.layer != 3 {
            return None;
        }
        // Some writers leave out the checksum that their header announces.
        let offsets = [HEADER + header.side_info(), HEADER + 2 + header.side_info()];
        offsets
            .iter()
            .find_map(|&at| Self::xing(frame.get(at..)?))
            .or_else(|| Self::vbri(frame.get(HEADER + 32..)?))
    }

    /// ```text
    /// 0  "Xing" or "Info"    4  u32 flags: 1 frames, 2 bytes, 4 table, 8 quality
    /// 8  the fields named by the flags: u32, u32, 100 bytes, u32
    ///    then, by LAME and lavc: 9 bytes encoder, 12 bytes, u24: delay and padding of 12 bits each
    /// ```
    fn xing(body: &[u8]) -> Option<Self> {
        if !body.starts_with(b"Xing") && !body.starts_with(b"Info") {
            return None;
        }
        let u32_at = |at: usize| Some(u32::from_be_bytes(*body.get(at..)?.first_chunk()?));
        let flags = u32_at(4)?;
        let frames = (flags & 1 != 0).then(|| u32_at(8)).flatten();
        let at = if flags & 1 != 0 { 12 } else { 8 };
        let bytes = (flags & 2 != 0).then(|| u32_at(at)).flatten();
        let fields = [(1, 4), (2, 4), (4, 100), (8, 4)];
        let at =
            8 + fields.iter().filter(|(bit, _)| flags & bit != 0).map(|(_, n)| n).sum::<usize>();
        let is_known =
            |name: &[u8]| [b"LAME", b"Lavf", b"Lavc"].iter().any(|k| name.starts_with(*k));
        let trim = match body.get(at..at + 24) {
            Some(lame) if is_known(lame) => {
                let both = u32::from_be_bytes([0, lame[21], lame[22], lame[23]]);
                let (delay, padding) = (both >> 12, both & 0xfff);
                (delay + DECODER_DELAY, padding.saturating_sub(DECODER_DELAY))
            }
            _ => (0, 0),
        };
        Some(Self { frames, bytes, trim })
    }

    /// Fraunhofer's: "VBRI", u16 version, delay, quality, u32 bytes, frames.
    fn vbri(body: &[u8]) -> Option<Self> {
        let fields = body.strip_prefix(b"VBRI")?;
        let u32_at = |at: usize| Some(u32::from_be_bytes(*fields.get(at..)?.first_chunk()?));
        Some(Self { frames: Some(u32_at(10)?), bytes: u32_at(6), trim: (0, 0) })
    }
}
