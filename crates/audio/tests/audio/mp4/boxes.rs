//! Boxes around packets of AAC.

use super::{FRAME, ONE, adts_frames};

pub fn boxed(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
    [&(body.len() as u32 + 8).to_be_bytes(), kind.as_slice(), body].concat()
}

pub fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

/// A file to be written; change the fields that a test is about.
#[derive(Clone)]
pub struct Movie {
    pub packets: Vec<Vec<u8>>,
    /// Type of the description, and what follows its 28 bytes.
    pub coding: ([u8; 4], Vec<u8>),
    pub handler: [u8; 4],
    /// Length in 1/1000 s, start in frames, rate.
    pub edits: Vec<(u32, i32, u32)>,
    /// Packets, duration of each.
    pub times: Vec<(u32, u32)>,
    /// Packets of a chunk; chunks are stored in this order.
    pub chunk: usize,
    pub is_reversed: bool,
    pub is_index_first: bool,
    pub has_long_offsets: bool,
    /// Bytes of something else before each chunk.
    pub between: usize,
    /// Sizes that the table states instead.
    pub sizes: Option<Vec<u32>>,
}

/// `esds` with a configuration of AAC.
pub fn esds(object: u8, config: &[u8]) -> Vec<u8> {
    let inner = [&[5, config.len() as u8], config].concat();
    let decoder = [&[4, 13 + inner.len() as u8, object, 0x15], &[0; 11][..], &inner].concat();
    let stream = [&[3, 0x80, 0x80, 3 + decoder.len() as u8, 0, 0, 0][..], &decoder].concat();
    boxed(b"esds", &[&[0; 4][..], &stream].concat())
}

impl Movie {
    /// All packets, as ffmpeg writes them.
    pub fn new() -> Self {
        let packets: Vec<_> = adts_frames().iter().map(|frame| frame[7..].to_vec()).collect();
        Self {
            times: vec![(packets.len() as u32 - 1, FRAME as u32), (1, 65)],
            packets,
            coding: (*b"mp4a", esds(0x40, &[0x12, 0x10])),
            handler: *b"soun",
            edits: vec![(211, FRAME as i32, ONE)],
            chunk: 4,
            is_reversed: false,
            is_index_first: true,
            has_long_offsets: false,
            between: 0,
            sizes: None,
        }
    }

    pub fn index(&self, offsets: &[u64], more: &[u8]) -> Vec<u8> {
        let entries = |kind: &[u8; 4], count: usize, entries: Vec<u8>| {
            boxed(kind, &[words(&[0, count as u32]), entries].concat())
        };
        let mut entry = vec![0; 28];
        entry[17] = 2;
        entry.extend(&self.coding.1);
        let sizes: Vec<u32> = self.packets.iter().map(|packet| packet.len() as u32).collect();
        let sizes = self.sizes.as_ref().unwrap_or(&sizes);
        let times: Vec<u32> = self.times.iter().flat_map(|(n, each)| [*n, *each]).collect();
        let table = [
            entries(b"stsd", 1, boxed(&self.coding.0, &entry)),
            entries(b"stts", self.times.len(), words(&times)),
            entries(b"stsc", 1, words(&[1, self.chunk as u32, 1])),
            boxed(b"stsz", &[words(&[0, 0, sizes.len() as u32]), words(sizes)].concat()),
            if self.has_long_offsets {
                let all = offsets.iter().flat_map(|offset| offset.to_be_bytes()).collect();
                entries(b"co64", offsets.len(), all)
            } else {
                let all: Vec<u32> = offsets.iter().map(|offset| *offset as u32).collect();
                entries(b"stco", offsets.len(), words(&all))
            },
        ];
        let edits: Vec<u32> = self.edits.iter().flat_map(|e| [e.0, e.1 as u32, e.2]).collect();
        let handler = [&[0; 8], self.handler.as_slice(), &[0; 13]].concat();
        let media = [
            boxed(b"mdhd", &words(&[0, 0, 0, 44_100, 0, 0])),
            boxed(b"hdlr", &handler),
            boxed(b"minf", &boxed(b"stbl", &table.concat())),
        ];
        let track = [
            boxed(b"tkhd", &words(&[7, 0, 0, 1, 0])),
            boxed(b"edts", &entries(b"elst", self.edits.len(), words(&edits))),
            boxed(b"mdia", &media.concat()),
        ];
        let video = boxed(b"trak", &boxed(b"mdia", &boxed(b"hdlr", b"\0\0\0\0\0\0\0\0vide\0")));
        let header = boxed(b"mvhd", &words(&[0, 0, 0, 1000, 0, 0]));
        boxed(b"moov", &[&header[..], &video, &boxed(b"trak", &track.concat()), more].concat())
    }

    pub fn bytes(&self) -> Vec<u8> {
        let start = boxed(b"ftyp", b"M4A \0\0\x02\0isom");
        let chunks: Vec<Vec<u8>> = self.packets.chunks(self.chunk).map(<[_]>::concat).collect();
        let index = self.index(&vec![0; chunks.len()], &[]).len();
        let first = start.len() + if self.is_index_first { index } else { 0 };
        let mut offsets = vec![0; chunks.len()];
        let mut data = Vec::new();
        let mut order: Vec<usize> = (0..chunks.len()).collect();
        if self.is_reversed {
            order.reverse();
        }
        for at in order {
            data.extend(vec![0xa5; self.between]);
            offsets[at] = (first + 8 + data.len()) as u64;
            data.extend(&chunks[at]);
        }
        let (index, data) = (self.index(&offsets, &[]), boxed(b"mdat", &data));
        if self.is_index_first { [start, index, data] } else { [start, data, index] }.concat()
    }
}

/// A fragment: bytes before its data begin are counted from its own start.
pub struct Fragment<'a> {
    pub packets: &'a [Vec<u8>],
    pub time: Option<u32>,
    /// What is wrong with where its data are said to be.
    pub shift: i32,
    pub last: u32,
}

pub fn fragment(f: &Fragment<'_>) -> Vec<u8> {
    let body = |ahead: i32| {
        let mut run = words(&[0x301, f.packets.len() as u32, ahead.cast_unsigned()]);
        for (at, packet) in f.packets.iter().enumerate() {
            let duration = if at + 1 == f.packets.len() { f.last } else { FRAME as u32 };
            run.extend(words(&[duration, packet.len() as u32]));
        }
        let time = f.time.map(|time| boxed(b"tfdt", &words(&[0, time]))).unwrap_or_default();
        let track = [boxed(b"tfhd", &words(&[0x2_0000, 1])), time, boxed(b"trun", &run)].concat();
        let other = boxed(b"traf", &boxed(b"tfhd", &words(&[0x2_0000, 2])));
        boxed(b"moof", &[boxed(b"mfhd", &[0; 8]), other, boxed(b"traf", &track)].concat())
    };
    let ahead = body(0).len() as i32 + 8 + f.shift;
    [body(ahead), boxed(b"mdat", &f.packets.concat())].concat()
}

/// The start of a fragmented file.
pub fn initial() -> Vec<u8> {
    let movie = Movie {
        packets: Vec::new(),
        times: Vec::new(),
        edits: vec![(0, FRAME as i32, ONE)],
        ..Movie::new()
    };
    let extends = boxed(b"mvex", &boxed(b"trex", &words(&[0, 1, 1, 1024, 0, 0])));
    [boxed(b"ftyp", b"iso5\0\0\x02\0iso5"), movie.index(&[], &extends)].concat()
}
