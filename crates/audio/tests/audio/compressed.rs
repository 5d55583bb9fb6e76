//! FLAC, Ogg Vorbis and MP3.

use std::path::Path;

use corsmal_audio::{Repair, open};

use crate::common::{read_file, read_pipe, shared};

/// `make_samples.py` wrote them.
pub const FLAC: &[u8] = include_bytes!("samples/steps-8ch-16bit.flac");
pub const OGG: &[u8] = include_bytes!("samples/sines-2ch.ogg");
pub const MP3: &[u8] = include_bytes!("samples/sine-1ch.mp3");
/// Sixteen frames of FLAC.
pub const BLOCKS: &[u8] = include_bytes!("samples/steps-2ch-blocks.flac");
/// Vorbis and Opus whose channel `n` is a sine of amplitude (n + 1) / 10.
pub const LEVELS: [&[u8]; 4] = [
    include_bytes!("samples/levels-4ch.ogg"),
    include_bytes!("samples/levels-6ch.ogg"),
    include_bytes!("samples/levels-8ch.ogg"),
    include_bytes!("samples/levels-8ch.opus"),
];
pub const SAMPLES: [&[u8]; 3] = [FLAC, OGG, MP3];

const FLAC_FRAMES: usize = 3000;
const LOSSY_FRAMES: usize = 30_000;

#[test]
fn flac_is_exact_and_keeps_the_channels_apart() {
    let got = read_file(FLAC.to_vec()).unwrap();
    assert_eq!((got.format.as_str(), got.channels, got.sample_rate), ("flac", 8, 48_000));
    assert_eq!(got.declared_frames, Some(FLAC_FRAMES as u64));
    assert!(got.report.repairs.is_empty());
    let step = |i: usize| ((i / 8 * 37 + i % 8 * 1001) % 20_011) as f32 - 10_005.0;
    let expected: Vec<f32> = (0..FLAC_FRAMES * 8).map(|i| step(i) / 32768.0).collect();
    assert_eq!(got.samples, expected);
}

/// Largest difference from a sine of amplitude 0.5, in the middle of the recording.
fn worst(samples: &[f32], channels: usize, channel: usize, hz: f64, sample_rate: u32) -> f64 {
    let error = |i: usize| {
        let phase = std::f64::consts::TAU * hz * i as f64 / f64::from(sample_rate);
        (f64::from(samples[i * channels + channel]) - 0.5 * phase.sin()).abs()
    };
    (1000..2000).map(error).fold(0.0, f64::max)
}

#[test]
fn lossy_formats_have_the_right_length_position_and_level() {
    let ogg = read_file(OGG.to_vec()).unwrap();
    assert_eq!((ogg.format.as_str(), ogg.channels, ogg.sample_rate), ("ogg vorbis", 2, 44_100));
    let mp3 = read_file(MP3.to_vec()).unwrap();
    assert_eq!((mp3.format.as_str(), mp3.channels, mp3.sample_rate), ("mp3", 1, 44_100));
    for got in [&ogg, &mp3] {
        assert_eq!(got.samples.len(), LOSSY_FRAMES * got.channels);
        assert_eq!(got.declared_frames, Some(LOSSY_FRAMES as u64));
        assert!(got.report.repairs.is_empty());
        for channel in 0..got.channels {
            let hz = [440.0, 1000.0][channel];
            let worst = worst(&got.samples, got.channels, channel, hz, got.sample_rate);
            assert!(worst < 0.04, "{} channel {channel}: {worst}", got.format);
        }
    }
}

/// symphonia alone mixes these channels up.
#[test]
fn channels_of_ogg_are_apart_and_in_the_order_of_wav() {
    for bytes in LEVELS {
        let got = read_file(bytes.to_vec()).unwrap();
        assert!(got.report.repairs.is_empty());
        assert_eq!(got.declared_frames, Some((got.samples.len() / got.channels) as u64));
        assert_eq!(got.samples, read_pipe(bytes.to_vec()).unwrap().samples);
        // Encoders cut the low-frequency channel off below the sine.
        let is_low = |channel: &usize| *channel == 3 && got.channels == 6;
        for channel in (0..got.channels).filter(|c| !is_low(c)) {
            let own = got.samples.iter().skip(channel).step_by(got.channels);
            let energy: f32 = own.skip(1000).take(4000).map(|y| y * y).sum();
            let (level, expected) = ((energy / 2000.0).sqrt(), (channel + 1) as f32 / 10.0);
            assert!((level - expected).abs() < 0.05, "{} {channel}: {level}", got.format);
        }
    }
}

#[test]
fn pipes_give_the_same_samples() {
    for bytes in SAMPLES {
        let (file, pipe) = (read_file(bytes.to_vec()).unwrap(), read_pipe(bytes.to_vec()).unwrap());
        assert!(!file.samples.is_empty());
        assert_eq!((&file.format, &file.report), (&pipe.format, &pipe.report));
        assert_eq!(file.samples, pipe.samples);
    }
}

#[test]
fn truncated_files_give_what_is_there() {
    for bytes in SAMPLES {
        let whole = read_file(bytes.to_vec()).unwrap();
        let got = read_file(bytes[..bytes.len() * 4 / 5].to_vec()).unwrap();
        assert!(got.report.truncated, "{}", got.format);
        let last = got.report.repairs.last();
        assert!(matches!(last, Some(Repair::Truncated { .. })), "{last:?}");
        let n = got.samples.len();
        assert!(n < whole.samples.len() && got.samples == whole.samples[..n]);
    }
}

#[test]
fn chained_ogg_goes_on() {
    let once = read_file(OGG.to_vec()).unwrap();
    let twice = read_file([OGG, OGG].concat()).unwrap();
    assert_eq!(twice.samples.len(), 2 * once.samples.len());
    assert_eq!(twice.samples[..once.samples.len()], once.samples);
}

#[test]
fn headers_alone_are_no_recording() {
    for bytes in [b"OggS".as_slice(), b"fLaC", b"ID3\x04\0\0\0\0\0\0", b"\xff\xfb\x90\x64"] {
        let error = read_file(bytes.to_vec()).unwrap_err();
        assert!(["corrupt", "unsupported"].contains(&error.verdict().name()), "{error}");
    }
}

#[test]
fn every_esc10_clip_has_the_frames_of_its_table() {
    let Some(root) = shared("data/esc10") else { return };
    let table = std::fs::read_to_string(root.join("meta.csv")).unwrap();
    let mut lines = table.lines();
    let columns: Vec<_> = lines.next().unwrap().split(',').collect();
    let column = |name| columns.iter().position(|c| *c == name).expect("column");
    let (file, frames) = (column("file"), column("frames"));
    let mut clips = 0;
    for line in lines {
        let cells: Vec<_> = line.split(',').collect();
        let path = root.join("audio").join(cells[file]);
        assert_eq!(frames_of(&path), cells[frames].parse().unwrap(), "{}", path.display());
        clips += 1;
    }
    assert_eq!(clips, 400);
}

fn frames_of(path: &Path) -> u64 {
    let mut source = open(path).unwrap();
    let mut block = vec![0.0; 16_384];
    while source.read(&mut block).unwrap() > 0 {}
    assert!(source.health().repairs.is_empty());
    source.health().decoded_frames
}
