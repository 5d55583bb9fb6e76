//! The shared cases: files that people reported, with what a reader should make of them.

use std::io::Cursor;

use corsmal_audio::from_reader;

use crate::common::{read_file, read_with, shared};

/// File, frames, repairs.
const CASES: [(&str, usize, &[&str]); 21] = [
    ("vbr_notag_loud_then_silent.mp3", 531_072, &[]),
    ("cbr_notag_short.mp3", 32_256, &[]),
    ("cbr_notag_sox.mp3", 32_256, &[]),
    ("cbr_notag_cut.mp3", 133_632, &[]),
    ("vbr_notag_false_truncated.mp3", 442_368, &[]),
    ("cbr_notag_ape.mp3", 32_256, &[]),
    ("cbr_notag_tail_zeros.mp3", 442_368, &[]),
    ("xing_frames_less.mp3", 30_000, &["longer_than_declared"]),
    ("vbri_less.mp3", 32_256, &["longer_than_declared"]),
    ("mp3_cat.mp3", 60_000, &["concatenated"]),
    ("mp3_zeros_head2.mp3", 30_000, &[]),
    ("mp3_junk_head.mp3", 32_256, &[]),
    ("free.mp3", 30_000, &[]),
    ("flac_tail_id3v1.flac", 30_000, &[]),
    ("fltail_nl.flac", 30_000, &[]),
    ("flac_minblk0.flac", 30_000, &[]),
    ("vc_badcount.flac", 30_000, &[]),
    ("flac_midbyte.flac", 30_000, &["lost_frames"]),
    ("id3_wav.wav", 30_000, &[]),
    ("ffcopy_ss.ogg", 30_080, &[]),
    ("ext_ambisonic16.wav", 5000, &[]),
];

#[test]
fn every_reported_file_is_read_rightly() {
    let Some(root) = shared("cases") else { return };
    for (name, frames, repairs) in CASES {
        let bytes = std::fs::read(root.join(name)).unwrap();
        let file = read_file(bytes.clone()).unwrap();
        assert_eq!(file.samples.len() / file.channels, frames, "{name}");
        assert_eq!(file.repairs(), repairs, "{name}");
        let longest = 2 * frames as u64;
        assert!(
            file.declared_frames.is_none_or(|n| n <= longest),
            "{name}: {:?}",
            file.declared_frames
        );
        let mut source = from_reader(Cursor::new(bytes)).unwrap();
        let pipe = read_with(source.as_mut(), [1, 700, 37].into_iter().cycle()).unwrap();
        assert_eq!(file.samples, pipe.samples, "{name}");
    }
}
