//! What stands before the audio, and files that end there.

use crate::common::{Wav, read_file, read_pipe};
use crate::compressed::{BLOCKS, FLAC, LEVELS, MP3, OGG};
use crate::damage::{mp3_frames, read_both, refusal};

#[test]
fn the_search_for_the_beginning_ends_at_the_same_byte_of_a_pipe() {
    for bytes in [MP3, FLAC, OGG] {
        let plain = read_both(bytes);
        for (length, is_read) in [(60_000, true), (65_535, true), (65_536, false), (100_000, false)]
        {
            let bytes = [&vec![1; length], bytes].concat();
            if is_read {
                assert!(read_both(&bytes).samples == plain.samples, "{length}");
            } else {
                assert_eq!(refusal(&bytes).verdict().name(), "not_audio", "{length}");
            }
        }
    }
}

#[test]
fn another_format_behind_the_audio_is_not_taken_for_it() {
    let frames = mp3_frames();
    let bare = frames[1..].concat();
    let plain = read_both(&bare);
    let wav = Wav::pcm16(2, &[1; 500]).bytes();
    for tail in [wav.as_slice(), FLAC, OGG] {
        let got = read_both(&[bare.as_slice(), tail].concat());
        assert_eq!(got.format, "mp3");
        assert!(got.samples == plain.samples);
    }
}

#[test]
fn files_that_end_early_are_refused_or_read_but_do_not_panic() {
    for bytes in [FLAC, BLOCKS, OGG, MP3, LEVELS[3]] {
        for length in 0..300.min(bytes.len()) {
            let file = read_file(bytes[..length].to_vec()).map(|got| got.samples);
            let pipe = read_pipe(bytes[..length].to_vec()).map(|got| got.samples);
            assert_eq!(file.is_ok(), pipe.is_ok(), "{length} bytes");
            assert_eq!(file.ok(), pipe.ok(), "{length} bytes");
        }
    }
}
