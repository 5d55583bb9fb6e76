//! Where the packets of a track are, from its tables: `stsz`, `stts`, `stsc`, `stco`.
//!
//! The tables stay as they stand in the file; a number of entries is a claim.

use super::boxes::{child, u32_at, u64_at};

/// One packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Packet {
    /// Its byte in the file, as the tables count.
    pub(super) offset: u64,
    pub(super) size: u32,
    /// In units of the track's time scale.
    pub(super) duration: u32,
    /// Whether the first description of the track is its own.
    pub(super) is_described: bool,
    /// When it begins, where that is said.
    pub(super) time: Option<u64>,
}

/// Sizes of packets.
#[derive(Debug, Clone)]
enum Sizes {
    Equal(u32, u64),
    /// Bits of an entry, and the entries.
    Each(u8, Vec<u8>),
}

impl Sizes {
    fn count(&self) -> u64 {
        match self {
            Self::Equal(_, count) => *count,
            Self::Each(bits, entries) => 8 * entries.len() as u64 / u64::from(*bits),
        }
    }

    fn get(&self, at: u64) -> Option<u32> {
        match self {
            Self::Equal(size, count) => (at < *count).then_some(*size),
            Self::Each(4, entries) => {
                let byte = entries.get(usize::try_from(at / 2).ok()?)?;
                Some(u32::from(if at.is_multiple_of(2) { byte >> 4 } else { byte & 15 }))
            }
            Self::Each(bits, entries) => {
                let width = usize::from(*bits) / 8;
                let at = usize::try_from(at).ok()?.checked_mul(width)?;
                let entry = entries.get(at..)?.get(..width)?;
                Some(entry.iter().fold(0, |n, byte| n << 8 | u32::from(*byte)))
            }
        }
    }
}

/// Entries of a fixed width, as many as are claimed and there.
#[derive(Debug, Clone, Default)]
struct Entries {
    width: usize,
    bytes: Vec<u8>,
}

impl Entries {
    /// The number of entries stands at byte 4.
    fn new(body: Option<&[u8]>, width: usize) -> Self {
        let body = body.unwrap_or_default();
        let claimed = u32_at(body, 4).unwrap_or(0) as usize;
        let entries = body.get(8..).unwrap_or_default();
        let bytes = entries[..entries.len().min(claimed.saturating_mul(width))].to_vec();
        Self { width, bytes }
    }

    fn get(&self, at: usize) -> Option<&[u8]> {
        self.bytes.get(at.checked_mul(self.width)?..)?.get(..self.width)
    }

    /// The number in field `field` of entry `at`.
    fn number(&self, at: usize, field: usize) -> Option<u32> {
        u32_at(self.get(at)?, 4 * field)
    }
}

/// The tables of a track.
#[derive(Debug, Clone)]
pub(super) struct Table {
    sizes: Sizes,
    /// Number of packets, duration of each.
    times: Entries,
    /// First chunk, packets of a chunk, description.
    chunks: Entries,
    /// Where chunks begin.
    offsets: Entries,
}

impl Table {
    /// Reads the boxes inside of `stbl`.
    pub(super) fn parse(stbl: &[u8]) -> Self {
        let sizes = match (child(stbl, b"stsz"), child(stbl, b"stz2")) {
            (Some(body), _) => {
                let count = u32_at(body, 8).unwrap_or(0);
                match u32_at(body, 4).unwrap_or(0) {
                    0 => each(32, count, body),
                    size => Sizes::Equal(size, count.into()),
                }
            }
            (None, Some(body)) => match body.get(7) {
                Some(bits @ (4 | 8 | 16)) => each(*bits, u32_at(body, 8).unwrap_or(0), body),
                _ => Sizes::Equal(0, 0),
            },
            (None, None) => Sizes::Equal(0, 0),
        };
        let offsets = match child(stbl, b"stco") {
            Some(body) => Entries::new(Some(body), 4),
            None => Entries::new(child(stbl, b"co64"), 8),
        };
        Self {
            sizes,
            times: Entries::new(child(stbl, b"stts"), 8),
            chunks: Entries::new(child(stbl, b"stsc"), 12),
            offsets,
        }
    }

    fn offset(&self, chunk: usize) -> Option<u64> {
        let entry = self.offsets.get(chunk)?;
        if entry.len() == 4 { u32_at(entry, 0).map(u64::from) } else { u64_at(entry, 0) }
    }

    /// Duration of all packets, and of the last one where all others last `regular`.
    pub(super) fn duration(&self, regular: u32) -> (u64, Option<u32>) {
        let (mut left, mut total, mut last) = (self.sizes.count(), 0u64, None);
        let mut is_regular = true;
        for at in 0.. {
            let (Some(count), Some(each)) = (self.times.number(at, 0), self.times.number(at, 1))
            else {
                break;
            };
            let count = u64::from(count).min(left);
            if count == 0 {
                continue;
            }
            left -= count;
            total = total.saturating_add(count.saturating_mul(each.into()));
            let is_last = left == 0;
            is_regular &= each == regular || (is_last && count == 1);
            last = Some(each);
        }
        let packets = left.saturating_mul(last.unwrap_or(regular).into());
        (total.saturating_add(packets), last.filter(|_| is_regular && left == 0))
    }

    /// Whether the packets after byte `floor` follow each other in the file.
    pub(super) fn is_in_order(&self, floor: u64) -> bool {
        let mut chunks = Chunks::new(self);
        let mut end = floor;
        while let Some(chunk) = chunks.next(self) {
            if chunk.offset < floor {
                continue;
            }
            if chunk.offset < end {
                return false;
            }
            end = chunk.offset.saturating_add(match &self.sizes {
                Sizes::Equal(size, _) => u64::from(*size).saturating_mul(chunk.count),
                Sizes::Each(..) => (chunk.first..chunk.first.saturating_add(chunk.count))
                    .map_while(|at| self.sizes.get(at))
                    .map(u64::from)
                    .sum(),
            });
        }
        true
    }
}

fn each(bits: u8, count: u32, body: &[u8]) -> Sizes {
    let entries = body.get(12..).unwrap_or_default();
    let claimed = (u64::from(count) * u64::from(bits)).div_ceil(8);
    let n = usize::try_from(claimed).map_or(entries.len(), |n| n.min(entries.len()));
    Sizes::Each(bits, entries[..n].to_vec())
}

/// Packets that lie side by side.
#[derive(Debug, Clone, Copy)]
struct Chunk {
    offset: u64,
    /// The number of its first packet.
    first: u64,
    count: u64,
    is_described: bool,
}

/// Goes through the chunks.
#[derive(Debug, Clone, Default)]
struct Chunks {
    chunk: usize,
    /// The entry of `stsc` that counts.
    entry: usize,
    first: u64,
    packets: u64,
}

impl Chunks {
    fn new(table: &Table) -> Self {
        Self { packets: table.sizes.count(), ..Self::default() }
    }

    /// The next chunk that holds packets.
    fn next(&mut self, table: &Table) -> Option<Chunk> {
        loop {
            let offset = table.offset(self.chunk)?;
            self.chunk += 1;
            let begins = |entry: usize| Some(table.chunks.number(entry, 0)? as usize);
            while begins(self.entry + 1).is_some_and(|first| first <= self.chunk) {
                self.entry += 1;
            }
            let count = u64::from(table.chunks.number(self.entry, 1)?);
            let count = count.min(self.packets - self.first);
            if count > 0 {
                let first = self.first;
                self.first += count;
                let is_described = table.chunks.number(self.entry, 2) == Some(1);
                return Some(Chunk { offset, first, count, is_described });
            }
            if self.first == self.packets {
                return None;
            }
        }
    }
}

/// Goes through the packets.
#[derive(Debug, Clone)]
pub(super) struct Packets {
    table: Table,
    chunks: Chunks,
    chunk: Option<Chunk>,
    /// The entry of `stts` that counts, and how many packets of it are left.
    time: usize,
    left: u32,
    duration: u32,
}

impl Packets {
    /// `duration` of a packet where the table does not say it.
    pub(super) fn new(table: Table, duration: u32) -> Self {
        let chunks = Chunks::new(&table);
        Self { table, chunks, chunk: None, time: 0, left: 0, duration }
    }

    pub(super) fn next(&mut self) -> Option<Packet> {
        let chunk = match self.chunk.as_mut().filter(|chunk| chunk.count > 0) {
            Some(chunk) => chunk,
            None => self.chunk.insert(self.chunks.next(&self.table)?),
        };
        let size = self.table.sizes.get(chunk.first)?;
        let (offset, is_described) = (chunk.offset, chunk.is_described);
        chunk.offset = offset.saturating_add(size.into());
        chunk.first += 1;
        chunk.count -= 1;
        while self.left == 0 {
            let times = &self.table.times;
            let (Some(count), Some(each)) =
                (times.number(self.time, 0), times.number(self.time, 1))
            else {
                self.left = u32::MAX;
                break;
            };
            (self.left, self.duration) = (count, each);
            self.time += 1;
        }
        self.left -= 1;
        Some(Packet { offset, size, duration: self.duration, is_described, time: None })
    }
}
