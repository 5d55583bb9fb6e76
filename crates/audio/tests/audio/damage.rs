//! Neighbours of what people reported: odd lengths, foreign bytes, damage, several recordings in a
//! file. Every case is read as a file and as a pipe, with the same result.

use corsmal_audio::{AudioError, Repair};

use crate::common::{Recording, Wav, read_file, read_pipe};
use crate::compressed::{BLOCKS, FLAC, MP3, OGG};

pub fn read_both(bytes: &[u8]) -> Recording {
    let file = read_file(bytes.to_vec()).unwrap();
    let pipe = read_pipe(bytes.to_vec()).unwrap();
    assert_eq!(file.samples, pipe.samples);
    assert_eq!(file.repairs(), pipe.repairs());
    file
}

pub fn refusal(bytes: &[u8]) -> AudioError {
    let error = read_file(bytes.to_vec()).unwrap_err();
    assert_eq!(error.verdict(), read_pipe(bytes.to_vec()).unwrap_err().verdict());
    error
}

fn id3v2(size: usize) -> Vec<u8> {
    let length = [size >> 21, size >> 14, size >> 7, size].map(|n| (n & 127) as u8);
    let mut tag = b"ID3\x04\0\0".to_vec();
    tag.extend(length);
    tag.resize(10 + size, 0);
    tag
}

fn ape() -> Vec<u8> {
    let mut footer = b"APETAGEX".to_vec();
    for n in [2000u32, 32, 0, 0, 0, 0] {
        footer.extend(n.to_le_bytes());
    }
    footer
}

#[test]
fn what_stands_before_or_behind_does_not_matter() {
    let wav = Wav::pcm16(2, &[1, -2, 3, -4, 5, -6]).bytes();
    let heads = [id3v2(200), id3v2(150_000), [id3v2(30), id3v2(40)].concat(), vec![0; 500]];
    let tails = [
        [b"TAG".as_slice(), &[b'x'; 125]].concat(),
        [vec![0; 4096], b"\n".to_vec()].concat(),
        ape(),
        b"junk of some length, no frame in it".to_vec(),
    ];
    for bytes in [wav.as_slice(), FLAC, BLOCKS, OGG, MP3] {
        let plain = read_both(bytes);
        for head in &heads {
            let got = read_both(&[head, bytes].concat());
            assert_eq!((&got.samples, got.repairs()), (&plain.samples, vec![]), "{}", got.format);
        }
        for tail in &tails {
            let got = read_both(&[bytes, tail.as_slice()].concat());
            assert_eq!((&got.samples, got.repairs()), (&plain.samples, vec![]), "{}", got.format);
        }
    }
}

/// The frames of the sample, whose first one is a tag: 44.1 kHz, MPEG 1, layer 3.
pub fn mp3_frames() -> Vec<&'static [u8]> {
    const KBITS: [usize; 15] = [0, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320];
    let (mut frames, mut rest) = (Vec::new(), MP3);
    while rest.len() > 4 {
        assert_eq!(&rest[..2], b"\xff\xfb");
        let size =
            144_000 * KBITS[usize::from(rest[2] >> 4)] / 44_100 + usize::from(rest[2] >> 1 & 1);
        let (frame, more) = rest.split_at(size);
        frames.push(frame);
        rest = more;
    }
    frames
}

/// The place of the count of frames in the tag.
fn count_at() -> usize {
    let at = MP3.windows(4).position(|w| w == b"Info" || w == b"Xing").expect("a tag");
    at + 8
}

#[test]
fn lengths_in_the_tag_of_mp3_are_claims() {
    let with = |count: u32| {
        let mut bytes = MP3.to_vec();
        bytes[count_at()..count_at() + 4].copy_from_slice(&count.to_be_bytes());
        read_both(&bytes)
    };
    let plain = read_both(MP3);
    for count in [0, 10] {
        let got = with(count);
        assert_eq!((got.repairs(), &got.samples), (vec!["longer_than_declared"], &plain.samples));
    }
    // Nothing is padding at the end of a recording that is cut off.
    let got = with(1000);
    assert_eq!(got.repairs(), ["truncated"]);
    assert!(got.samples.starts_with(&plain.samples) && got.samples.len() > plain.samples.len());
}

#[test]
fn mp3_without_a_tag_is_read_to_its_last_whole_frame() {
    let frames = mp3_frames();
    let bare = frames[1..].concat();
    let got = read_both(&bare);
    assert_eq!(got.samples.len(), 1152 * (frames.len() - 1));
    assert_eq!((got.repairs(), got.declared_frames), (vec![], None));
    let cut = read_both(&bare[..bare.len() - 20]);
    assert_eq!(cut.samples, got.samples[..got.samples.len() - 1152]);
    assert_eq!(cut.repairs(), ["partial_frame"]);
    // A partial frame in front, as of a stream that was joined late, and a shorter silence in its
    // reservoir than the frames want.
    let late = read_both(&[&frames[1][frames[1].len() / 2..], &frames[2..].concat()].concat());
    assert_eq!((late.samples.len(), late.repairs()), (1152 * (frames.len() - 2), vec![]));
}

#[test]
fn recordings_in_one_file_are_all_read() {
    for bytes in [MP3, FLAC, BLOCKS] {
        let once = read_both(bytes);
        let got = read_both(&[bytes, bytes].concat());
        assert_eq!(got.samples, [once.samples.clone(), once.samples.clone()].concat());
        let at = (once.samples.len() / once.channels) as u64;
        assert_eq!(got.report.repairs, [Repair::Concatenated { at }]);
        let got = read_both(&[bytes, &id3v2(100), bytes].concat());
        assert_eq!(got.samples.len(), 2 * once.samples.len());
    }
    // Another number of channels would be another recording.
    assert_eq!(refusal(&[FLAC, BLOCKS].concat()).verdict().name(), "unsupported");
}

#[test]
fn samples_of_wav_that_are_not_read_are_said() {
    let first = Wav::pcm16(1, &[1, 2, 3]).bytes();
    let plain = read_both(&first);
    let second = [b"data\x04\0\0\0", &[1, 0, 2, 0][..]].concat();
    let list = b"LIST\x03\0\0\0abc\0";
    for (bytes, at) in [
        ([first.as_slice(), &first].concat(), first.len()),
        ([first.as_slice(), &second].concat(), first.len()),
        ([first.as_slice(), list, &second].concat(), first.len() + list.len()),
    ] {
        let got = read_file(bytes.clone()).unwrap();
        assert_eq!(got.report.repairs, [Repair::MoreData { offset: at as u64 }]);
        assert_eq!(got.samples, plain.samples);
        // A pipe may stay open, so nothing is looked for after its samples.
        assert_eq!(read_pipe(bytes).unwrap().samples, plain.samples);
    }
    for tail in [list.as_slice(), b"data\0\0\0\0", b"da"] {
        assert_eq!(read_both(&[first.as_slice(), tail].concat()).repairs(), Vec::<&str>::new());
    }
}

#[test]
fn damaged_frames_of_mp3_are_silence_of_their_length() {
    let frames = mp3_frames();
    // One of a variable bit rate, and two of those that have the same one.
    let constant: Vec<_> = frames.iter().copied().filter(|f| f[2] >> 4 == 5).collect();
    assert!(constant.len() > 8, "{} frames of 64 kbit/s", constant.len());
    for (frames, at, count, trimmed) in [(frames, 11, 1, 1105), (constant, 3, 2, 0)] {
        let plain = read_both(&frames.concat());
        let mut damaged: Vec<Vec<u8>> = frames.iter().map(|f| f.to_vec()).collect();
        for frame in &mut damaged[at..at + count] {
            frame[..4].fill(0);
        }
        let got = read_both(&damaged.concat());
        assert_eq!(got.samples.len(), plain.samples.len());
        // The tag is not a frame of audio; delay of encoder and decoder are dropped.
        let before = if trimmed > 0 { at - 1 } else { at };
        let (first, end) = (before * 1152 - trimmed, (before + count) * 1152 - trimmed);
        let lost = Repair::LostFrames { first: first as u64, count: (end - first) as u64 };
        assert_eq!(got.report.repairs, [lost]);
        assert!(got.samples[first..end].iter().all(|y| *y == 0.0));
        // The end is at its time; overlap and reservoir are filled again there.
        let last = got.samples.len() - 1152;
        assert!(last > end && got.samples[last..] == plain.samples[last..]);
    }
}

#[test]
fn bytes_between_frames_of_mp3_take_no_time() {
    let frames = mp3_frames();
    let (head, tail) = (frames[..11].concat(), frames[11..].concat());
    let got = read_both(&[head.as_slice(), &[b'x'; 50], &tail].concat());
    assert_eq!((&got.samples, got.repairs()), (&read_both(MP3).samples, vec!["foreign_bytes"]));
}

/// Where the frames of the FLAC sample begin, of 192 samples in two channels each.
pub fn flac_frames() -> Vec<usize> {
    let mark = &BLOCKS[first_flac_frame()..][..4];
    let all = (0..BLOCKS.len() - 4).filter(|&at| BLOCKS[at..at + 3] == mark[..3]);
    all.collect()
}

fn first_flac_frame() -> usize {
    let mut at = 4;
    loop {
        let (kind, length) = (BLOCKS[at], &BLOCKS[at + 1..at + 4]);
        at += 4 + length.iter().fold(0, |n, b| n << 8 | usize::from(*b));
        if kind & 0x80 != 0 {
            return at;
        }
    }
}

#[test]
fn damage_in_flac_is_silence_at_its_time() {
    let plain = read_both(BLOCKS);
    let starts = flac_frames();
    // The last one is shorter, which its header says.
    assert_eq!(starts.len(), 15);
    // The sixth frame: a byte of it changed, and the whole of it missing.
    let mut changed = BLOCKS.to_vec();
    changed[(starts[5] + starts[6]) / 2] ^= 0x55;
    let removed = [&BLOCKS[..starts[5]], &BLOCKS[starts[6]..]].concat();
    let (first, count) = (5 * 192, 192);
    let mut expected = plain.samples.clone();
    expected[2 * first..2 * (first + count)].fill(0.0);
    for bytes in [changed, removed] {
        let got = read_both(&bytes);
        assert_eq!(got.samples, expected);
        let lost = Repair::LostFrames { first: first as u64, count: count as u64 };
        assert_eq!(got.report.repairs, [lost]);
    }
    // Where the beginning is missing, the recording begins later.
    let late = read_both(&[&BLOCKS[..starts[0]], &BLOCKS[starts[3]..]].concat());
    assert_eq!(late.samples, plain.samples[2 * 3 * 192..]);
    assert_eq!(late.report.repairs, [Repair::TimeJump { at: 0, frames: 3 * 192 }]);
}

#[test]
fn metadata_of_flac_may_be_broken() {
    let plain = read_both(BLOCKS);
    let (head, frames) = (&BLOCKS[..4 + 4 + 34], &BLOCKS[first_flac_frame()..]);
    let with = |kind: u8, body: &[u8]| {
        let mut bytes = head.to_vec();
        bytes[4] &= 0x7f;
        bytes.push(0x80 | kind);
        bytes.extend(&(body.len() as u32).to_be_bytes()[1..]);
        bytes.extend(body);
        bytes.extend(frames);
        bytes
    };
    let blocks: [(u8, &[u8]); 6] = [
        (4, b"\x01\0\0\0e\x63\0\0\0"),
        (4, b"\xff\xff\xff\xffe"),
        (6, b"\0\0\0\x03\0\0\0\x0a\xe9mage\xffjpeg\0\0\0\0"),
        (5, &[0; 100]),
        (3, &[0; 20]),
        (100, b"xyz"),
    ];
    for (kind, body) in blocks {
        assert_eq!(read_both(&with(kind, body)), plain);
    }
    // Block sizes of 0, frame sizes of 0, no checksum of the samples.
    for (at, length) in [(8, 2), (8, 4), (12, 6), (26, 16)] {
        let mut bytes = BLOCKS.to_vec();
        bytes[at..at + length].fill(0);
        assert_eq!(read_both(&bytes).samples, plain.samples);
    }
    // Numbers of samples that are wrong: the last four bytes of the field are enough here.
    for (count, repair) in [(100u32, "longer_than_declared"), (90_000, "truncated")] {
        let mut bytes = BLOCKS.to_vec();
        bytes[22..26].copy_from_slice(&count.to_be_bytes());
        let got = read_both(&bytes);
        assert_eq!((got.samples, got.report.repairs[0].name()), (plain.samples.clone(), repair));
    }
}

/// Where the pages of an Ogg file begin.
fn pages(bytes: &[u8]) -> Vec<usize> {
    (0..bytes.len() - 4).filter(|&at| &bytes[at..at + 4] == b"OggS").collect()
}

#[test]
fn missing_pages_of_ogg_are_silence_at_their_time() {
    let plain = read_both(OGG);
    let starts = pages(OGG);
    // Two pages of headers, three of audio.
    let n = starts.len();
    assert_eq!(n, 5);
    let mut damaged = Vec::new();
    for page in [2, 3] {
        let mut changed = OGG.to_vec();
        changed[starts[page] + 100] ^= 1;
        damaged.push((page, changed));
        damaged.push((page, [&OGG[..starts[page]], &OGG[starts[page + 1]..]].concat()));
    }
    for (page, bytes) in damaged {
        let got = read_both(&bytes);
        assert_eq!(got.samples.len(), plain.samples.len());
        let [Repair::LostFrames { first, count }] = got.report.repairs[..] else {
            panic!("{:?}", got.report)
        };
        let (first, end) = (2 * first as usize, 2 * (first + count) as usize);
        assert!(got.samples[..first] == plain.samples[..first]);
        assert!(got.samples[first..end].iter().all(|y| *y == 0.0));
        // How much the last page cuts off cannot be told without the page before it.
        if page == 2 {
            assert!(end < plain.samples.len() && got.samples[end..] == plain.samples[end..]);
        }
    }
    let cut = read_both(&OGG[..starts[n - 1]]);
    assert_eq!(cut.repairs(), ["truncated"]);
    assert_eq!(cut.samples, plain.samples[..cut.samples.len()]);
}

#[test]
fn other_formats_are_named() {
    let mut speex = OGG.to_vec();
    speex[28..36].copy_from_slice(b"Speex   ");
    for (bytes, name) in [
        (b"\x1a\x45\xdf\xa3 and so on, more bytes".as_slice(), "Matroska"),
        (b"\0\x05\x16\x07\0\x02\0\0Mac OS X   ", "macOS"),
    ] {
        let error = refusal(bytes);
        assert_eq!(error.verdict().name(), "unsupported");
        assert!(error.to_string().contains(name), "{error}");
    }
    // A changed page has a wrong checksum: nothing is left of the stream.
    assert_eq!(refusal(&speex).verdict().name(), "corrupt");
    let free = b"\xff\xfd\x00\xc4".iter().copied().chain([0; 300]).collect::<Vec<_>>().repeat(5);
    assert!(refusal(&free).to_string().contains("layer 2 in free format"));
}
