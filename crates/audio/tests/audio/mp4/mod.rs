//! MP4, M4A and QuickTime: files of ffmpeg, and boxes built here around packets of AAC. Every file is
//! read as a file and as a pipe, with the same result.

mod boxes;

use corsmal_audio::Repair;

use crate::common::{Recording, read_file, read_pipe};
use boxes::{Fragment, Movie, boxed, esds, fragment, initial};

/// `make_samples.py` wrote them: 9281 frames of two sines in AAC, 5000 of six channels in ALAC.
pub const AAC: &[u8] = include_bytes!("../samples/sines-2ch.aac");
pub const M4A: &[u8] = include_bytes!("../samples/sines-2ch.m4a");
pub const FRAGMENTS: &[u8] = include_bytes!("../samples/sines-2ch-fragments.mp4");
pub const ALAC: &[u8] = include_bytes!("../samples/steps-6ch.m4a");

/// Samples per channel of a packet; the encoder puts as many before the recording.
const FRAME: usize = 1024;
const FRAMES: usize = 9281;
const ONE: u32 = 0x1_0000;

pub fn read_both(bytes: &[u8]) -> Recording {
    let file = read_file(bytes.to_vec()).unwrap();
    assert_eq!(file, read_pipe(bytes.to_vec()).unwrap());
    file
}

fn refusal(bytes: &[u8]) -> String {
    let error = read_file(bytes.to_vec()).unwrap_err();
    assert_eq!(error.verdict(), read_pipe(bytes.to_vec()).unwrap_err().verdict());
    format!("{}: {error}", error.verdict().name())
}

/// The packets of the sample in ADTS, with their headers.
pub fn adts_frames() -> Vec<&'static [u8]> {
    let (mut frames, mut rest) = (Vec::new(), AAC);
    while rest.len() > 7 {
        let size =
            usize::from(rest[3] & 3) << 11 | usize::from(rest[4]) << 3 | usize::from(rest[5] >> 5);
        let (frame, more) = rest.split_at(size);
        frames.push(frame);
        rest = more;
    }
    frames
}

/// What the packets decode to.
fn stream() -> Vec<f32> {
    read_both(AAC).samples
}

fn samples_of(frames: std::ops::Range<usize>) -> Vec<f32> {
    stream()[2 * frames.start..2 * frames.end].to_vec()
}

#[test]
fn files_of_ffmpeg_have_the_length_that_was_encoded() {
    // ffmpeg writes no edit list into fragments, so that the delay stays.
    for (bytes, frames) in [(M4A, FRAME..FRAME + FRAMES), (FRAGMENTS, 0..FRAME + FRAMES)] {
        let got = read_both(bytes);
        assert_eq!((got.format.as_str(), got.channels, got.sample_rate), ("mp4 aac", 2, 44_100));
        assert_eq!((got.samples.len(), got.repairs()), (2 * frames.len(), vec![]));
        assert!(got.samples == samples_of(frames));
    }
    assert_eq!(read_both(M4A).declared_frames, Some(FRAMES as u64));
    let got = read_both(AAC);
    assert_eq!((got.format.as_str(), got.samples.len()), ("adts aac", 2 * 11 * FRAME));
    // A sine of 440 and one of 1000 Hz, without delay.
    let got = read_both(M4A).samples;
    for (channel, hz) in [(0, 440.0), (1, 1000.0)] {
        let error = |t: usize| {
            let phase = std::f64::consts::TAU * hz * t as f64 / 44_100.0;
            (f64::from(got[2 * t + channel]) - 0.5 * phase.sin()).abs()
        };
        let worst = (4000..8000).map(error).fold(0.0, f64::max);
        assert!(worst < 0.11, "{channel}: {worst}");
    }
}

#[test]
fn alac_is_exact_and_in_the_order_of_wav() {
    let got = read_both(ALAC);
    assert_eq!((got.format.as_str(), got.channels, got.sample_rate), ("mp4 alac", 6, 48_000));
    assert_eq!((got.declared_frames, got.repairs()), (Some(5000), vec![]));
    let step = |i: usize| ((i / 6 * 37 + i % 6 * 1001) % 20_011) as f32 - 10_005.0;
    let expected: Vec<f32> = (0..5000 * 6).map(|i| step(i) / 32768.0).collect();
    assert!(got.samples == expected);
}

#[test]
fn any_order_of_boxes_and_chunks_gives_the_same_samples() {
    let expected = samples_of(FRAME..FRAME + FRAMES);
    let plain = Movie::new();
    for movie in [
        plain.clone(),
        Movie { is_index_first: false, ..plain.clone() },
        Movie { chunk: 1, has_long_offsets: true, ..plain.clone() },
        Movie { chunk: 100, ..plain.clone() },
        Movie { chunk: 2, between: 3000, ..plain.clone() },
        Movie { is_reversed: true, ..plain.clone() },
        Movie { is_reversed: true, is_index_first: false, ..plain.clone() },
    ] {
        let bytes = movie.bytes();
        for head in [Vec::new(), b"ID3\x04\0\0\0\0\0\x05hello".to_vec()] {
            let got = read_both(&[head, bytes.clone()].concat());
            assert!(got.samples == expected && got.repairs().is_empty());
        }
        // QuickTime of old begins without a type.
        let got = read_both(&[&boxed(b"wide", &[0; 12]), &bytes[20..]].concat());
        assert!(got.samples == expected);
    }
}

#[test]
fn edits_say_what_is_the_recording() {
    let with = |edits: &[(u32, i32, u32)]| {
        read_both(&Movie { edits: edits.to_vec(), ..Movie::new() }.bytes())
    };
    // None at all: all samples but the padding that the last duration leaves out.
    assert_eq!(with(&[]).samples, samples_of(0..10 * FRAME + 65));
    // Cut in the middle; a pause between two stretches.
    let got = with(&[(100, 2000, ONE)]);
    assert_eq!((got.samples, got.declared_frames), (samples_of(2000..6410), Some(4410)));
    let got = with(&[(50, 1024, ONE), (10, -1, ONE), (50, 5000, ONE)]);
    let parts = [samples_of(1024..3229), vec![0.0; 882], samples_of(5000..7205)];
    assert_eq!((&got.samples, got.repairs()), (&parts.concat(), vec![]));
    // What begins late begins with its first sample, and that is said.
    let got = with(&[(100, -1, ONE), (211, 1024, ONE)]);
    assert_eq!(got.report.repairs, [Repair::TimeJump { at: 0, frames: 4410 }]);
    assert!(got.samples == samples_of(FRAME..FRAME + FRAMES));
    let refused = |edits: &[(u32, i32, u32)]| {
        refusal(&Movie { edits: edits.to_vec(), ..Movie::new() }.bytes())
    };
    assert!(refused(&[(100, 0, 2 * ONE)]).contains("unsupported at byte 0: MP4 with an edit"));
    assert!(refused(&[(100, 4410, ONE), (100, 0, ONE)]).contains("reorder"));
}

#[test]
fn durations_that_jitter_change_nothing() {
    // As phones write them: the clock of the system, not that of the samples.
    let times = vec![(3, 1024), (1, 1000), (3, 1048), (1, 1030), (2, 1010), (1, 900)];
    let got = read_both(&Movie { times, edits: vec![], ..Movie::new() }.bytes());
    assert_eq!((&got.samples, got.repairs()), (&samples_of(0..11 * FRAME), vec![]));
    // Where edits say where the end is, the table does.
    let times = vec![(3, 1024), (1, 1000), (3, 1048), (1, 1030), (3, 1000)];
    let got = read_both(&Movie { times, ..Movie::new() }.bytes());
    assert_eq!((&got.samples, got.repairs()), (&samples_of(FRAME..FRAME + 9305), vec![]));
    let times = vec![(11, 0)];
    let got = read_both(&Movie { times, edits: vec![], ..Movie::new() }.bytes());
    assert!(got.samples == samples_of(0..11 * FRAME));
}

#[test]
fn what_is_lost_is_silence() {
    // A packet without bytes: its time is kept.
    let mut movie = Movie::new();
    movie.packets[5] = Vec::new();
    let got = read_both(&movie.bytes());
    let lost = Repair::LostFrames { first: 4 * FRAME as u64, count: FRAME as u64 };
    assert_eq!((got.samples.len(), got.report.repairs), (2 * FRAMES, vec![lost]));
    assert!(got.samples[..2 * 4 * FRAME] == samples_of(FRAME..5 * FRAME));
    assert!(got.samples[2 * 4 * FRAME..2 * 5 * FRAME].iter().all(|y| *y == 0.0));
    // From the second packet after it on, nothing shows.
    assert!(got.samples[2 * 6 * FRAME..] == samples_of(7 * FRAME..FRAME + FRAMES));
    // A gap in the time of the packets.
    let times = vec![(4, 1024), (1, 3 * 1024), (5, 1024), (1, 65)];
    let got = read_both(&Movie { times, edits: vec![(0, 1024, ONE)], ..Movie::new() }.bytes());
    let lost = Repair::LostFrames { first: 4 * FRAME as u64, count: 2 * FRAME as u64 };
    assert_eq!((got.samples.len() / 2, got.report.repairs), (FRAMES + 2 * FRAME, vec![lost]));
    assert!(got.samples[2 * 6 * FRAME..] == samples_of(5 * FRAME..10 * FRAME + 65));
}

#[test]
fn cut_files_give_what_is_there() {
    let bytes = Movie::new().bytes();
    let got = read_both(&bytes[..bytes.len() - 300]);
    assert!(got.report.truncated);
    let n = got.samples.len() / 2;
    let truncated = Repair::Truncated { declared: Some(FRAMES as u64), actual: n as u64 };
    assert_eq!(got.report.repairs, [truncated]);
    assert!(n > FRAME && got.samples == samples_of(FRAME..FRAME + n));
    // Without an index there is nothing to be done.
    let behind = Movie { is_index_first: false, ..Movie::new() }.bytes();
    assert!(refusal(&behind[..behind.len() - 100]).contains("the index (moov)"));
    assert!(refusal(&behind[..1500]).contains("a recorder writes last"));
    assert!(refusal(&bytes[..200]).contains("a whole index"));
    assert!(refusal(&bytes[..24]).contains("without an index"));
    // Offsets far after the end.
    let mut movie = Movie { chunk: 1, has_long_offsets: true, ..Movie::new() };
    movie.packets.truncate(1);
    let mut bytes = movie.bytes();
    let at = bytes.windows(4).position(|w| w == b"co64").expect("a table") + 12;
    bytes[at] = 0x7f;
    let got = read_both(&bytes);
    assert!(got.samples.is_empty() && got.report.truncated);
}

#[test]
fn what_is_not_read_is_named() {
    let with = |kind: &[u8; 4], inner: Vec<u8>| {
        refusal(&Movie { coding: (*kind, inner), ..Movie::new() }.bytes())
    };
    assert!(with(b"mp4a", esds(0x40, &[0x2b, 0x92, 0x08, 0])).contains("HE-AAC"));
    assert!(with(b"mp4a", esds(0x40, &[0x13, 0x90, 0x56, 0xe5, 0x98])).contains("HE-AAC"));
    assert!(with(b"mp4a", esds(0x40, &[0x11, 0xb0])).contains("AAC of 6 channels"));
    assert!(with(b"mp4a", esds(0x6b, &[])).contains("MP4 with MP3"));
    assert!(with(b"mp4a", Vec::new()).contains("corrupt"));
    assert!(with(b"ac-3", Vec::new()).contains("MP4 with AC-3"));
    assert!(with(b"enca", Vec::new()).contains("DRM"));
    assert!(with(b"zzzz", Vec::new()).contains("MP4 with \"zzzz\""));
    let video = Movie { handler: *b"vide", ..Movie::new() }.bytes();
    assert!(refusal(&video).contains("without sound (tracks: vide, vide)"));
}

#[test]
fn the_first_track_that_is_read_counts() {
    let bytes = Movie { is_index_first: false, ..Movie::new() }.bytes();
    let at = bytes.windows(4).rposition(|w| w == b"trak").expect("a track") - 4;
    let data = bytes.windows(4).position(|w| w == b"moov").expect("an index") - 4;
    let other = Movie { coding: (*b"ac-3", vec![]), packets: vec![vec![]], ..Movie::new() };
    let index = other.index(&[24], &bytes[at..]);
    let got = read_both(&[&bytes[..data], &index].concat());
    assert!(got.samples == samples_of(FRAME..FRAME + FRAMES));
}

#[test]
fn descriptions_of_quicktime_are_read() {
    // Version 1: 16 bytes more, and the description inside of `wave`.
    let mut movie = Movie::new();
    let wave = boxed(b"wave", &[boxed(b"frma", b"mp4a"), esds(0x40, &[0x12, 0x10])].concat());
    movie.coding.1 = [vec![0; 16], wave].concat();
    let mut bytes = movie.bytes();
    let at = bytes.windows(4).position(|w| w == b"mp4a").expect("a description") + 4;
    bytes[at + 9] = 1;
    assert!(read_both(&bytes).samples == samples_of(FRAME..FRAME + FRAMES));
}

#[test]
fn fragments_follow_each_other() {
    let packets = Movie::new().packets;
    let (head, tail) = packets.split_at(6);
    let part = |packets, time, last| fragment(&Fragment { packets, time, shift: 0, last });
    let expected = samples_of(FRAME..FRAME + FRAMES);
    let end = part(tail, None, 65);
    let got = read_both(&[initial(), part(head, None, 1024), end.clone()].concat());
    assert!(got.samples == expected && got.repairs().is_empty() && got.declared_frames.is_none());
    // Boxes between, and times.
    let between = boxed(b"sidx", &[0; 24]);
    let timed = part(tail, Some(6 * 1024), 65);
    let all = [initial(), between.clone(), part(head, Some(0), 1024), between, timed].concat();
    assert!(read_both(&all).samples == expected);
    // A segment went missing.
    let late = part(tail, Some(8 * 1024), 65);
    let got = read_both(&[initial(), part(head, Some(0), 1024), late].concat());
    let lost = Repair::LostFrames { first: 5 * FRAME as u64, count: 2 * FRAME as u64 };
    assert_eq!((got.samples.len() / 2, got.report.repairs), (FRAMES + 2 * FRAME, vec![lost]));
    // A recording that was joined late begins there.
    let got = read_both(&[initial(), part(head, Some(90_000), 1024)].concat());
    assert_eq!(got.report.repairs, [Repair::TimeJump { at: 0, frames: 90_000 }]);
    assert!(got.samples == samples_of(0..6 * FRAME));
    // Data that lie elsewhere, the first of them before the file, are silence, also where what is there
    // misleads the decoder. What follows is in its place.
    let lost = Fragment { packets: head, time: None, shift: -4000, last: 1024 };
    let got = read_both(&[initial(), fragment(&lost), end.clone()].concat());
    assert_eq!((got.samples.len() / 2, got.repairs()), (FRAMES, vec!["lost_frames"]));
    // The end is cut off.
    let whole = [initial(), part(head, None, 1024), end].concat();
    let got = read_both(&whole[..whole.len() - 200]);
    let n = got.samples.len() / 2;
    assert_eq!(got.report.repairs, [Repair::Truncated { declared: None, actual: n as u64 }]);
    assert!(got.samples == samples_of(FRAME..FRAME + n));
}

/// Files whose index is near their beginning, for the mutations.
pub fn seeds() -> Vec<Vec<u8>> {
    let packets = &Movie::new().packets[..4];
    let part = Fragment { packets, time: Some(0), shift: 0, last: 1024 };
    let short = Movie { packets: packets.to_vec(), chunk: 2, ..Movie::new() };
    vec![
        short.bytes(),
        Movie { is_index_first: false, is_reversed: true, ..short }.bytes(),
        [initial(), fragment(&part)].concat(),
    ]
}

#[test]
fn numbers_from_outside_bound_nothing() {
    let bytes = Movie::new().bytes();
    let at = |kind: &[u8; 4]| bytes.windows(4).position(|w| w == kind).expect("a box") + 4;
    // Counts of entries, sizes of all packets, packets of a chunk.
    for (kind, field) in [
        (b"stsz", 8),
        (b"stsz", 4),
        (b"stts", 4),
        (b"stsc", 4),
        (b"stco", 4),
        (b"stsc", 12),
        (b"elst", 4),
    ] {
        for value in [u32::MAX, 1, 0x10_0000] {
            let mut bytes = bytes.clone();
            let at = at(kind) + field;
            bytes[at..at + 4].copy_from_slice(&value.to_be_bytes());
            let (file, pipe) = (read_file(bytes.clone()), read_pipe(bytes));
            match (file, pipe) {
                (Ok(file), Ok(pipe)) => assert_eq!(file, pipe),
                (file, pipe) => assert!(file.is_err() && pipe.is_err()),
            }
        }
    }
}

#[test]
fn adts_is_read_past_junk_and_damage() {
    let frames = adts_frames();
    let expected = stream();
    for head in [&b"junk that is no frame"[..], b"ID3\x04\0\0\0\0\0\x05hello", &frames[0][50..]] {
        let got = read_both(&[head, AAC].concat());
        assert!(got.samples == expected && got.repairs().is_empty());
    }
    let got = read_both(&[AAC, b"TAG", &[b'x'; 125]].concat());
    assert_eq!((got.samples == expected, got.repairs()), (true, vec![]));
    // A few foreign bytes take no time; a damaged header takes that of its frame.
    let got = read_both(&[&frames[..4].concat()[..], b"few", &frames[4..].concat()].concat());
    assert_eq!((got.samples == expected, got.repairs()), (true, vec!["foreign_bytes"]));
    let mut bytes = AAC.to_vec();
    bytes[frames[..5].concat().len()] = 0;
    let got = read_both(&bytes);
    let lost = Repair::LostFrames { first: 5 * FRAME as u64, count: FRAME as u64 };
    assert_eq!((got.samples.len(), &got.report.repairs[..]), (expected.len(), &[lost][..]));
    assert!(got.samples[2 * 7 * FRAME..] == expected[2 * 7 * FRAME..]);
    let got = read_both(&AAC[..AAC.len() - 5]);
    assert_eq!(got.repairs(), ["partial_frame"]);
    assert!(got.samples == expected[..2 * 10 * FRAME]);
    // Another configuration, and none that is read.
    let mut other = AAC.to_vec();
    let mut at = 0;
    for frame in &frames {
        other[at + 2] = other[at + 2] & !0x3c | 8 << 2;
        at += frame.len();
    }
    assert!(refusal(&[AAC, &other].concat()).contains("a change of rate"));
    let mut main = AAC.to_vec();
    at = 0;
    for frame in &frames {
        main[at + 2] &= 0x3f;
        at += frame.len();
    }
    assert!(refusal(&main).contains("unsupported at byte 0: AAC Main"));
}
