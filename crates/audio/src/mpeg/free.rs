//! Layer 3 in free format: frames of a size that the standard has no bit rate for, which the decoder
//! refuses. Each becomes a frame of the largest standard size with the same side information.
//!
//! Main data are laid out anew, each as early as `main_data_begin` allows: so the room that frames
//! leave serves the later ones that need more than a standard frame has.

use super::header::{HEADER, Header};

/// Index of the highest bit rate.
const HIGHEST: u8 = 14;

/// Turns frames of free format into standard ones.
#[derive(Default)]
pub(super) struct Repacker {
    /// Main data before the frame, as far back as it can refer to them.
    history: Vec<u8>,
    /// Bytes of its main data that the packet before holds.
    placed: usize,
    /// Bytes before the end of that packet at which they begin.
    begin: usize,
    packet: Vec<u8>,
}

/// Side information, as far as it says where the main data of a frame are.
struct SideInfo {
    /// Bytes before the main data of the frame itself at which they begin.
    begin: usize,
    /// Bytes.
    length: usize,
}

impl Repacker {
    /// Forgets the frames before.
    pub(super) fn reset(&mut self) {
        self.history.clear();
        (self.placed, self.begin) = (0, 0);
    }

    /// A silent packet to decode before the first frame, where that one has more main data than room.
    pub(super) fn primer(&mut self, header: &Header, frame: &[u8]) -> Option<&[u8]> {
        if !self.history.is_empty() || self.placed > 0 {
            return None;
        }
        let data = self.main_data(header, frame)?;
        let (size, side) = (header.largest_size(), header.side_info());
        let ahead = data.len().saturating_sub(size - HEADER - side);
        if ahead == 0 || ahead > furthest(header.mpeg1) {
            return None;
        }
        self.packet.clear();
        self.packet.extend(standard(frame));
        self.packet.resize(size, 0);
        self.packet[size - ahead..].copy_from_slice(&data[..ahead]);
        (self.placed, self.begin) = (ahead, ahead);
        Some(&self.packet)
    }

    /// The packet for `frame`, which the frame `next` may follow; `None` where its data are not all
    /// there or have no room.
    pub(super) fn packet(
        &mut self,
        header: &Header,
        frame: &[u8],
        next: Option<(&Header, &[u8])>,
    ) -> Option<&[u8]> {
        let size = header.largest_size();
        let (placed, begin) = (std::mem::take(&mut self.placed), std::mem::take(&mut self.begin));
        let data = self.main_data(header, frame);
        self.remember(header, frame);
        let after = next.and_then(|(header, frame)| self.main_data(header, frame));
        let (side, data) = (side_info(header, frame)?, data?);
        let room = size - HEADER - side.len();
        let rest = data.get(placed..).filter(|rest| rest.len() <= room)?;
        self.packet.clear();
        self.packet.extend(standard(frame));
        self.packet.extend_from_slice(side);
        set_begin(&mut self.packet[HEADER..], header.mpeg1, begin);
        self.packet.extend_from_slice(rest);
        let end = self.packet.len();
        self.packet.resize(size, 0);
        if let Some(after) = after {
            let at = end.max(size - furthest(header.mpeg1));
            let placed = after.len().min(size - at);
            self.packet[at..at + placed].copy_from_slice(&after[..placed]);
            (self.placed, self.begin) = (placed, size - at);
        }
        Some(&self.packet)
    }

    /// The main data of the frame after the history.
    fn main_data(&self, header: &Header, frame: &[u8]) -> Option<Vec<u8>> {
        let side = SideInfo::parse(side_info(header, frame)?, header)?;
        let own = &frame[payload(header, frame)..];
        let back = self.history.get(self.history.len().checked_sub(side.begin)?..)?;
        let mut data = [back, own].concat();
        (data.len() >= side.length).then(|| data.truncate(side.length))?;
        Some(data)
    }

    fn remember(&mut self, header: &Header, frame: &[u8]) {
        self.history.extend(frame.get(payload(header, frame)..).unwrap_or_default());
        let excess = self.history.len().saturating_sub(furthest(header.mpeg1));
        self.history.drain(..excess);
    }
}

/// The header of a frame with the highest bit rate, without check sum and padding.
fn standard(frame: &[u8]) -> [u8; HEADER] {
    [frame[0], frame[1] | 1, frame[2] & 0x0d | HIGHEST << 4, frame[3]]
}

/// How many bytes back main data may begin.
fn furthest(mpeg1: bool) -> usize {
    if mpeg1 { 511 } else { 255 }
}

/// Where side information begins: a check sum may come before.
fn side_start(frame: &[u8]) -> usize {
    HEADER + if frame.get(1).is_some_and(|byte| byte & 1 == 0) { 2 } else { 0 }
}

fn side_info<'f>(header: &Header, frame: &'f [u8]) -> Option<&'f [u8]> {
    frame.get(side_start(frame)..payload(header, frame))
}

/// Where the main data of the frame itself begin.
fn payload(header: &Header, frame: &[u8]) -> usize {
    side_start(frame) + header.side_info()
}

fn set_begin(side: &mut [u8], mpeg1: bool, begin: usize) {
    if mpeg1 {
        side[0] = (begin >> 1) as u8;
        side[1] = side[1] & 0x7f | ((begin & 1) << 7) as u8;
    } else {
        side[0] = begin as u8;
    }
}

impl SideInfo {
    fn parse(side: &[u8], header: &Header) -> Option<Self> {
        let mut at = 0;
        let mut take = |bits: usize| -> Option<usize> {
            let value = (at..at + bits).try_fold(0, |value, bit| {
                Some(value << 1 | usize::from(side.get(bit / 8)? >> (7 - bit % 8) & 1))
            });
            at += bits;
            value
        };
        let channels = usize::from(header.channels);
        let begin = take(if header.mpeg1 { 9 } else { 8 })?;
        // Private bits, and which scale factors the second granule shares.
        let (unused, granules, rest) = match (header.mpeg1, channels) {
            (true, 1) => (5 + 4, 2, 59 - 12),
            (true, _) => (3 + 8, 2, 59 - 12),
            (false, 1) => (1, 1, 63 - 12),
            (false, _) => (2, 1, 63 - 12),
        };
        take(unused)?;
        let mut bits = 0;
        for _ in 0..granules * channels {
            bits += take(12)?;
            take(rest)?;
        }
        Some(Self { begin, length: bits.div_ceil(8) })
    }
}
