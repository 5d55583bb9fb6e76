//! Recordings of every format: blocks of any length, a pipe, a place reached by seeking, and a stretch read
//! after another give the same samples.
#![no_main]

use std::io::Cursor;
use std::ops::Range;

use corsmal_audio::{BlockSource, Replay, SampleEncoding, from_reader, from_seekable};

/// Frames that are compared.
const MOST: usize = 1 << 16;

/// Samples up to [`MOST`] frames, and whether the end was reached in order.
fn drain(source: &mut dyn BlockSource, block: usize) -> (Vec<u32>, bool) {
    let channels = usize::from(source.spec().channels);
    let mut buffer = vec![0.0; block * channels];
    let mut bits = Vec::new();
    while bits.len() < MOST * channels {
        match source.read(&mut buffer) {
            Ok(0) => return (bits, true),
            Ok(frames) => bits.extend(buffer[..frames * channels].iter().map(|x| x.to_bits())),
            Err(_) => return (bits, false),
        }
    }
    bits.truncate(MOST * channels);
    (bits, true)
}

/// The samples of a stretch, as far as they can be read.
fn stretch(source: &mut dyn BlockSource, frames: &Range<u64>) -> Vec<u32> {
    let channels = usize::from(source.spec().channels);
    let mut bits = Vec::new();
    if source.go_to(frames.start).is_err() {
        return bits;
    }
    let mut left = (frames.end - frames.start) as usize;
    let mut buffer = vec![0.0; 100 * channels];
    while left > 0 {
        match source.read(&mut buffer[..left.min(100) * channels]) {
            Ok(0) | Err(_) => break,
            Ok(read) => {
                bits.extend(buffer[..read * channels].iter().map(|x| x.to_bits()));
                left -= read;
            }
        }
    }
    bits
}

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    let file = Cursor::new(bytes.to_vec());
    let Ok(mut source) = from_seekable(file.clone()) else { return };
    let channels = usize::from(source.spec().channels);
    let (whole, sound) = drain(source.as_mut(), 1024);
    let mut small = from_seekable(file.clone()).expect("it opened before");
    // It looks elsewhere in the file and comes back.
    let _ = small.confirmed_frames();
    assert!(drain(small.as_mut(), 7) == (whole.clone(), sound), "blocks of other lengths");
    if let Ok(mut pipe) = from_reader(file.clone()) {
        let piped = drain(pipe.as_mut(), 311);
        // A pipe of plain samples cannot be asked for its length, by which wrong sizes are repaired.
        let compressed =
            matches!(source.spec().encoding, SampleEncoding::Lossy | SampleEncoding::Lossless);
        assert!(!compressed || piped == (whole.clone(), sound), "a pipe");
    }
    let frames = whole.len() / channels;
    if !sound || frames == MOST {
        return;
    }
    let mut there = from_seekable(file.clone()).expect("it opened before");
    if there.seekable() {
        let at = frames / 3;
        if there.seek(at as u64).is_ok() {
            let (rest, sound) = drain(there.as_mut(), 100);
            assert!(!sound || rest == whole[at * channels..], "a seek to frame {at} of {frames}");
        }
        return;
    }
    let frames = frames as u64;
    let mut replay = Replay::new(there);
    stretch(&mut replay, &(0..frames / 2));
    for next in [frames / 4..frames / 2 + 1, frames / 2..frames, frames / 2..frames + 9] {
        if replay.serves(&next) {
            let mut alone = from_seekable(file.clone()).expect("it opened before");
            let (found, expected) = (stretch(&mut replay, &next), stretch(alone.as_mut(), &next));
            assert!(found == expected, "frames {next:?} of {frames} after others");
            assert_eq!(replay.health(), alone.health(), "frames {next:?} of {frames}");
        }
    }
});
