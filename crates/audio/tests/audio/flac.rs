//! FLAC whose stream information or first frames are damaged.

use corsmal_audio::Repair;

use crate::compressed::BLOCKS;
use crate::damage::{flac_frames, read_both};

/// Samples per channel of a frame of the sample.
const BLOCK: usize = 192;

/// The sample with another largest block in its stream information.
fn with_block(block: u16, frames: &[u8]) -> Vec<u8> {
    let mut bytes = BLOCKS[..flac_frames()[0]].to_vec();
    bytes[10..12].copy_from_slice(&block.to_be_bytes());
    [&bytes, frames].concat()
}

#[test]
fn frames_say_themselves_how_long_they_are() {
    let plain = read_both(BLOCKS);
    let starts = flac_frames();
    for block in [0, 16, 100, 191, 193, 4608, u16::MAX] {
        let got = read_both(&with_block(block, &BLOCKS[starts[0]..]));
        assert_eq!((got.repairs(), &got.samples), (vec![], &plain.samples), "{block}");
        // Where the first frames are missing, those that are there still tell the time.
        let got = read_both(&with_block(block, &BLOCKS[starts[3]..]));
        assert_eq!(got.samples, plain.samples[2 * 3 * BLOCK..], "{block}");
        assert_eq!(got.report.repairs, [Repair::TimeJump { at: 0, frames: 3 * BLOCK as u64 }]);
    }
    // The last frame is shorter: only the stream information tells how long the others were.
    let last = starts.len() - 1;
    let got = read_both(&with_block(BLOCK as u16, &BLOCKS[starts[last]..]));
    assert_eq!(got.report.repairs, [Repair::TimeJump { at: 0, frames: (last * BLOCK) as u64 }]);
}

#[test]
fn damaged_first_frames_are_silence_of_their_length() {
    let plain = read_both(BLOCKS);
    let starts = flac_frames();
    for count in [1, 2, 5] {
        let mut changed = BLOCKS.to_vec();
        for frame in 0..count {
            changed[(starts[frame] + starts[frame + 1]) / 2] ^= 0x55;
        }
        let mut blank = BLOCKS.to_vec();
        blank[starts[0]..starts[count]].fill(0);
        let mut expected = plain.samples.clone();
        expected[..2 * count * BLOCK].fill(0.0);
        for bytes in [changed, blank] {
            let got = read_both(&bytes);
            assert!(got.samples == expected, "{count} frames");
            let lost = Repair::LostFrames { first: 0, count: (count * BLOCK) as u64 };
            assert_eq!(got.report.repairs, [lost]);
        }
    }
}

#[test]
fn a_second_recording_that_is_cut_off_is_truncated_at_its_place() {
    let whole = (read_both(BLOCKS).samples.len() / 2) as u64;
    let starts = flac_frames();
    let got = read_both(&[BLOCKS, &BLOCKS[..starts[4]]].concat());
    let actual = whole + 4 * BLOCK as u64;
    let truncated = Repair::Truncated { declared: Some(2 * whole), actual };
    assert_eq!(got.report.repairs, [Repair::Concatenated { at: whole }, truncated]);
}
