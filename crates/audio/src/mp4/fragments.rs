//! Packets in fragments (`moof`), which follow each other in the file, each before its data.

use std::collections::VecDeque;

use super::boxes::{self, Head, child, children, u32_at, u64_at};
use super::table::Packet;
use super::track::Defaults;
use crate::error::AudioError;
use crate::input::Input;

/// Largest `moof` that is read.
const MAX_MOOF: u64 = 16 << 20;

/// Packets that lie side by side.
struct Run {
    offset: u64,
    left: u32,
    entries: Vec<u8>,
    /// Bytes of an entry, and where in it the duration and the size are.
    stride: usize,
    duration_at: Option<usize>,
    size_at: Option<usize>,
    at: usize,
    defaults: Defaults,
    /// When the first packet begins, where that is said.
    time: Option<u64>,
}

impl Run {
    fn next(&mut self) -> Option<Packet> {
        self.left = self.left.checked_sub(1)?;
        let entry = self.entries.get(self.at..).unwrap_or_default();
        self.at += self.stride;
        let size = self.size_at.and_then(|at| u32_at(entry, at)).unwrap_or(self.defaults.size);
        let duration = self.duration_at.and_then(|at| u32_at(entry, at));
        let offset = self.offset;
        self.offset = offset.saturating_add(size.into());
        Some(Packet {
            offset,
            size,
            duration: duration.unwrap_or(self.defaults.duration),
            is_described: self.defaults.description <= 1,
            time: self.time.take(),
        })
    }

    /// The byte after the last packet.
    fn end(&self) -> u64 {
        let sizes = match self.size_at {
            Some(at) => {
                let entries = self.entries.chunks_exact(self.stride).take(self.left as usize);
                entries.filter_map(|entry| u32_at(entry, at)).map(u64::from).sum()
            }
            None => u64::from(self.defaults.size) * u64::from(self.left),
        };
        self.offset.saturating_add(sizes)
    }
}

/// Goes through the packets of one track.
pub(super) struct Fragments {
    defaults: Defaults,
    /// Byte 0 of the offsets.
    base: u64,
    /// Where the next box at the top begins; `None` where the last one reaches to the end.
    boundary: Option<u64>,
    runs: VecDeque<Run>,
}

impl Fragments {
    /// The box after the movie begins at `boundary`.
    pub(super) fn new(defaults: Defaults, base: u64, boundary: u64) -> Self {
        Self { defaults, base, boundary: Some(boundary), runs: VecDeque::new() }
    }

    pub(super) fn next(&mut self, input: &mut Input) -> Result<Option<Packet>, AudioError> {
        loop {
            while let Some(run) = self.runs.front_mut() {
                if let Some(packet) = run.next() {
                    return Ok(Some(packet));
                }
                self.runs.pop_front();
            }
            if !self.next_fragment(input)? {
                return Ok(None);
            }
        }
    }

    /// Goes forward to byte `offset`; false where another fragment or the end comes before.
    pub(super) fn reach(&mut self, input: &mut Input, offset: u64) -> Result<bool, AudioError> {
        while let Some(boundary) = self.boundary.filter(|boundary| *boundary <= offset) {
            match self.head_at(input, boundary)? {
                Some(head) if &head.kind != b"moof" => {
                    self.boundary = head.size().and_then(|size| boundary.checked_add(size));
                }
                _ => return Ok(false),
            }
        }
        match offset.checked_sub(input.position()) {
            Some(ahead) => input.skip(ahead),
            None => Ok(false),
        }
    }

    fn head_at(&self, input: &mut Input, at: u64) -> Result<Option<Head>, AudioError> {
        let Some(ahead) = at.checked_sub(input.position()) else { return Ok(None) };
        if !input.skip(ahead)? {
            return Ok(None);
        }
        Ok(Head::parse(input.peek(boxes::SHOWN)?))
    }

    /// Goes on to the next fragment with packets of the track.
    fn next_fragment(&mut self, input: &mut Input) -> Result<bool, AudioError> {
        while let Some(boundary) = self.boundary {
            let Some(head) = self.head_at(input, boundary)? else { break };
            self.boundary = head.size().and_then(|size| boundary.checked_add(size));
            let Some(size) = head.body.filter(|n| &head.kind == b"moof" && *n <= MAX_MOOF) else {
                continue;
            };
            input.consume(head.length as usize);
            let moof = boxes::take(input, size as usize)?;
            self.read(&moof, boundary);
            if !self.runs.is_empty() {
                return Ok(true);
            }
        }
        self.boundary = None;
        Ok(false)
    }

    /// Reads the runs of a `moof` that begins at byte `start`.
    fn read(&mut self, moof: &[u8], start: u64) {
        let mut behind = start;
        let mut is_first = true;
        for (_, traf) in children(moof).filter(|(kind, _)| kind == b"traf") {
            let Some((track, flags, defaults, base)) =
                child(traf, b"tfhd").and_then(|body| header(body, &self.defaults))
            else {
                continue;
            };
            // Where nothing is said, the data of a track follow those of the one before.
            let base = match base {
                Some(base) => self.base.saturating_add(base),
                None if flags & 0x2_0000 != 0 || is_first => start,
                None => behind,
            };
            (behind, is_first) = (base, false);
            let mut time = child(traf, b"tfdt").and_then(|body| match body.first()? {
                1 => u64_at(body, 4),
                _ => u32_at(body, 4).map(u64::from),
            });
            for (_, trun) in children(traf).filter(|(kind, _)| kind == b"trun") {
                let Some(run) = run(trun, (base, behind), defaults, time) else { continue };
                behind = run.end();
                if track == self.defaults.track && run.left > 0 {
                    self.runs.push_back(run);
                    time = None;
                }
            }
        }
    }
}

/// `tfhd`: track, flags, defaults, and byte 0 of the data where that is said.
fn header(body: &[u8], defaults: &Defaults) -> Option<(u32, u32, Defaults, Option<u64>)> {
    let flags = u32_at(body, 0)? & 0xff_ffff;
    let mut at = 8;
    let mut field = |flag: u32, width: usize| {
        let found = (flags & flag != 0).then_some(at);
        at += if found.is_some() { width } else { 0 };
        found
    };
    let base = field(1, 8).and_then(|at| u64_at(body, at));
    let mut number =
        |flag: u32, default: u32| field(flag, 4).and_then(|at| u32_at(body, at)).unwrap_or(default);
    let own = Defaults {
        track: u32_at(body, 4)?,
        description: number(2, defaults.description),
        duration: number(8, defaults.duration),
        size: number(16, defaults.size),
    };
    Some((own.track, flags, own, base))
}

/// ```text
/// 0 flags   4 u32 packets   8 i32 from the base to the data (flag 1), u32 (flag 4)
///   then for each: u32 duration (0x100), size (0x200), flags (0x400), offset in time (0x800)
/// ```
fn run(
    body: &[u8],
    (base, behind): (u64, u64),
    defaults: Defaults,
    time: Option<u64>,
) -> Option<Run> {
    let flags = u32_at(body, 0)? & 0xff_ffff;
    let count = u32_at(body, 4)?;
    let mut at = 8;
    let mut offset = behind;
    if flags & 1 != 0 {
        let ahead = i64::from(u32_at(body, at)?.cast_signed());
        offset = base.saturating_add_signed(ahead);
        at += 4;
    }
    if flags & 4 != 0 {
        at += 4;
    }
    let mut stride = 0;
    let mut field = |flag: u32| {
        let found = (flags & flag != 0).then_some(stride);
        stride += if found.is_some() { 4 } else { 0 };
        found
    };
    let (duration_at, size_at) = (field(0x100), field(0x200));
    field(0x400);
    field(0x800);
    let entries = body.get(at..).unwrap_or_default();
    // Without entries, only the size of the packets bounds how many there can be.
    let left = match entries.len().checked_div(stride) {
        Some(there) => count.min(u32::try_from(there).unwrap_or(u32::MAX)),
        None if defaults.size == 0 => 0,
        None => count,
    };
    let entries = entries[..left as usize * stride].to_vec();
    Some(Run { offset, left, entries, stride, duration_at, size_at, at: 0, defaults, time })
}
