//! MPEG audio with other bytes between and after its frames.

use crate::common::read_pipe;
use crate::compressed::MP3;
use crate::damage::{mp3_frames, read_both, refusal};

/// Largest sample.
fn peak(samples: &[f32]) -> f32 {
    samples.iter().fold(0.0, |peak, y| peak.max(y.abs()))
}

/// Frames of layer 3 in MPEG 2.5 with 8 kbit/s at 8 kHz: 576 samples of silence in 72 bytes.
fn slow_frames(count: usize) -> Vec<u8> {
    let mut frame = vec![0xff, 0xe3, 0x18, 0xc4];
    frame.resize(72, 0);
    frame.repeat(count)
}

#[test]
fn frames_that_a_medium_lost_are_silence() {
    let frames = mp3_frames();
    let plain = read_both(MP3);
    let start = |frame: usize| frames[..frame].iter().map(|f| f.len()).sum::<usize>();
    for (value, count) in [(0, 4), (0xaa, 7)] {
        // From the middle of a frame to the middle of a later one.
        let mut bytes = MP3.to_vec();
        bytes[start(9) + 100..start(9 + count) + 100].fill(value);
        let got = read_both(&bytes);
        assert_eq!(got.samples.len(), plain.samples.len());
        assert!(got.report.loss().is_some() && got.repairs().contains(&"lost_frames"));
        assert!(peak(&got.samples) < 1.5 * peak(&plain.samples), "{}", peak(&got.samples));
        let last = got.samples.len() - 1152;
        assert_eq!(got.samples[last..], plain.samples[last..]);
    }
}

#[test]
fn so_many_other_bytes_that_they_may_have_been_frames_are_a_loss() {
    let frames = mp3_frames();
    let (head, tail) = (frames[..11].concat(), frames[11..].concat());
    let with = |junk: &[u8]| read_both(&[head.as_slice(), junk, &tail].concat());
    let junk: Vec<u8> = (0..40_000u32).map(|n| ((n * n) >> 7) as u8 & 0x7f).collect();
    assert!(with(&junk[..50]).report.loss().is_none());
    for length in [3000, 40_000] {
        let got = with(&junk[..length]);
        assert!(got.report.loss().is_some(), "{length}");
        assert_eq!(got.samples.len(), read_both(MP3).samples.len());
        assert!(got.repairs().contains(&"foreign_bytes"));
    }
}

#[test]
fn a_tag_longer_than_what_follows_is_passed_over_in_pipes_too() {
    let frames = mp3_frames();
    // It claims 127 MiB.
    let tag = b"ID3\x03\0\0\x3f\x7f\x7f\x7f";
    let head = [&frames[..9].concat(), &tag[..]].concat();
    let got = read_both(&[head.as_slice(), &frames[9..].concat()].concat());
    assert_eq!(got.samples.len(), read_both(MP3).samples.len());

    // More than a pipe is held back for: what follows it is lost, and that is said.
    let long = [head, slow_frames((17 << 20) / 72)].concat();
    let error = read_pipe(long).unwrap_err();
    assert_eq!(error.verdict().name(), "corrupt");
    assert!(error.to_string().contains("the end of the stream after"), "{error}");
}

#[test]
fn a_chance_header_behind_the_end_is_no_change_of_format() {
    let plain = read_both(MP3);
    // A frame of another sample rate that ends with the file, and one near its end.
    for behind in [0, 1, 3] {
        let mut chance = vec![0; 100];
        chance.extend(b"\xff\xfb\x14\xc4");
        chance.resize(chance.len() + 92 + behind, 0xab);
        let got = read_both(&[MP3, &chance].concat());
        assert!(got.samples == plain.samples, "{behind}");
    }
    // Many of them are.
    let other = [slow_frames(5), vec![0; 300]].concat();
    let error = refusal(&[MP3, &other].concat());
    assert_eq!(error.verdict().name(), "unsupported");
    assert!(error.to_string().contains("8000 Hz"), "{error}");
}

#[test]
fn silence_is_never_longer_than_an_hour() {
    let frames = slow_frames(20);
    for (count, value, filled) in [(30, 0, 30), (70_000, 0, 0), (70_000, 0x55, 0)] {
        let gap = vec![value; 72 * count];
        let got = read_both(&[frames.as_slice(), &gap, &frames].concat());
        assert_eq!(got.samples.len(), 576 * (40 + filled), "{count} frames of {value}");
        assert!(got.report.loss().is_some());
    }
}

/// Frames of one size, the first of which is a tag.
const CONSTANT: &[u8] = include_bytes!("samples/bursts-2ch-cbr.mp3");

/// The frames of [`CONSTANT`] with headers that do not tell their size.
fn free_format() -> Vec<Vec<u8>> {
    let (mut frames, mut rest) = (Vec::new(), CONSTANT);
    while rest.len() > 4 {
        let (frame, more) = rest.split_at(313 + usize::from(rest[2] >> 1 & 1));
        assert_eq!((&frame[..2], frame[2] >> 4), (b"\xff\xfb".as_slice(), 7));
        frames.push([&frame[..2], &[frame[2] & 0x0f], &frame[3..]].concat());
        rest = more;
    }
    frames
}

#[test]
fn free_format_gives_the_same_samples() {
    let (plain, frames) = (read_both(CONSTANT), free_format());
    assert_eq!(plain.samples.len(), 24_000);
    let got = read_both(&frames.concat());
    assert_eq!(got.samples, plain.samples);
    assert_eq!((got.repairs(), got.declared_frames), (plain.repairs(), plain.declared_frames));
    // With check sums, which nobody compares, and tags around; without the tag that tells the delay.
    let without = read_both(&CONSTANT[frames[0].len()..]);
    let mut checked: Vec<u8> = b"ID3\x04\0\0\0\0\0\x0a0123456789".to_vec();
    for frame in &frames[1..] {
        checked.extend([frame[0], frame[1] & 0xfe, frame[2], frame[3], 0, 0]);
        checked.extend(&frame[4..]);
    }
    checked.extend([b"TAG".as_slice(), &[0; 125]].concat());
    assert_eq!(read_both(&checked).samples, without.samples);
}

#[test]
fn frames_of_free_format_that_are_damaged_are_silence() {
    let (plain, mut frames) = (read_both(CONSTANT), free_format());
    let whole = frames.concat();
    frames[6][..4].fill(0);
    let got = read_both(&frames.concat());
    assert_eq!(got.samples.len(), plain.samples.len());
    assert!(got.repairs().contains(&"lost_frames"), "{:?}", got.repairs());
    // Cut in the middle of a frame.
    let cut = read_both(&whole[..whole.len() - 150]);
    assert!(cut.samples.len() < plain.samples.len() && cut.repairs().contains(&"partial_frame"));
}

#[test]
fn free_format_before_behind_and_within_other_bytes() {
    let (plain, free) = (read_both(CONSTANT), free_format().concat());
    let twice = plain.samples.repeat(2);
    // Without the tag of the second recording there is no delay to drop.
    for bytes in [[CONSTANT, &free].concat(), [&free, CONSTANT].concat()] {
        let got = read_both(&bytes);
        assert_eq!(got.samples.len(), twice.len());
        assert_eq!(got.samples[..plain.samples.len()], plain.samples);
        assert!(got.repairs().contains(&"concatenated"), "{:?}", got.repairs());
    }
    let front = [vec![0x55; 1000], free].concat();
    assert_eq!(read_both(&front).samples, plain.samples);
}

/// Samples without a header: where a tone crosses zero its bytes look like a header of free format.
#[test]
fn samples_of_a_tone_are_no_frames() {
    let period = [-20_000i16, -100, 250, 20_000, 9_000, 300, -9_000, -15_000].map(i16::to_le_bytes);
    for length in [24, 96, 200] {
        let mut one = period.concat();
        one.resize(2 * length, 1);
        assert_eq!(refusal(&one.repeat(400)).verdict().name(), "not_audio", "{length}");
    }
}
