//! Properties over random samples: encodings round-trip, splits do not matter, hound agrees.

use std::io::Cursor;

use crate::common::{Wav, read_file, read_pipe, read_with, tag};
use corsmal_audio::from_seekable;
use proptest::prelude::*;

/// One encoding: tag, bits, and how a sample of full scale 1 is stored and read back.
struct Encoding {
    tag: u16,
    bits: u16,
    store: fn(f64, bool) -> Vec<u8>,
    value: fn(f64) -> f32,
}

fn ordered<const N: usize>(little: [u8; N], big: bool) -> Vec<u8> {
    let mut bytes = little.to_vec();
    if big {
        bytes.reverse();
    }
    bytes
}

/// `x` as an integer of `bits` bits, rounded and clipped.
fn quantised(x: f64, bits: u32) -> i64 {
    let full = (1i64 << (bits - 1)) as f64;
    (x * full).round().clamp(-full, full - 1.0) as i64
}

fn integer<const BITS: u32>(x: f64, big: bool) -> Vec<u8> {
    let bytes = (BITS / 8) as usize;
    let mut little = quantised(x, BITS).to_le_bytes()[..bytes].to_vec();
    if big {
        little.reverse();
    }
    little
}

fn value<const BITS: u32>(x: f64) -> f32 {
    quantised(x, BITS) as f32 / (1u64 << (BITS - 1)) as f32
}

fn encodings() -> Vec<Encoding> {
    macro_rules! integers {
        ($($bits:literal)*) => {
            [$(Encoding {
                tag: tag::PCM,
                bits: $bits,
                store: integer::<$bits>,
                value: value::<$bits>,
            }),*]
        };
    }
    let mut all = Vec::from(integers![16 24 32 40 48 56]);
    all.push(Encoding {
        tag: tag::PCM,
        bits: 8,
        store: |x, _| vec![(quantised(x, 8) + 128) as u8],
        value: value::<8>,
    });
    all.push(Encoding {
        tag: tag::FLOAT,
        bits: 32,
        store: |x, big| ordered((x as f32).to_le_bytes(), big),
        value: |x| x as f32,
    });
    all.push(Encoding {
        tag: tag::FLOAT,
        bits: 64,
        store: |x, big| ordered(x.to_le_bytes(), big),
        value: |x| x as f32,
    });
    all
}

proptest! {
    #[test]
    fn every_encoding_round_trips(
        which in 0..9usize,
        big in any::<bool>(),
        extensible in any::<bool>(),
        channels in 1..=64u16,
        frames in 0..40usize,
        seed in prop::collection::vec(-1.0..1.0f64, 1..50),
    ) {
        let e = &encodings()[which];
        let x: Vec<f64> = seed.iter().cycle().take(frames * usize::from(channels)).copied().collect();
        let wav = Wav {
            form: if big { b"RIFX" } else { b"RIFF" },
            tag: e.tag,
            sub_format: extensible.then_some(e.tag),
            bits: e.bits,
            data: x.iter().flat_map(|&v| (e.store)(v, big)).collect(),
            ..Wav::pcm16(channels, &[])
        };
        let got = read_file(wav.bytes()).unwrap();
        let expected: Vec<f32> = x.iter().map(|&v| (e.value)(v)).collect();
        prop_assert_eq!(&got.samples, &expected);
        prop_assert_eq!(got, read_pipe(wav.bytes()).unwrap());
    }

    #[test]
    fn any_split_gives_the_same_samples(
        channels in 1..9u16,
        bits in prop::sample::select(vec![8u16, 16, 24, 32]),
        data in prop::collection::vec(any::<u8>(), 0..4000),
        sizes in prop::collection::vec(1..300usize, 1..20),
    ) {
        // Repeated so that the data cross the reader's buffer more than once.
        let data = data.repeat(80);
        let bytes = Wav { bits, data, ..Wav::pcm16(channels, &[]) }.bytes();
        let whole = read_file(bytes.clone()).unwrap();
        let mut source = from_seekable(Cursor::new(bytes)).unwrap();
        let split = read_with(source.as_mut(), sizes.into_iter().cycle()).unwrap();
        prop_assert_eq!(whole, split);
    }

    #[test]
    fn hound_writes_what_we_read(
        channels in 1..=8u16,
        bits in prop::sample::select(vec![8u16, 16, 24, 32]),
        sample_rate in 1..=768_000u32,
        seed in prop::collection::vec(any::<i32>(), 0..60),
    ) {
        let n = seed.len() / usize::from(channels) * usize::from(channels);
        let samples: Vec<i32> = seed[..n].iter().map(|s| s >> (32 - bits)).collect();
        let format = hound::SampleFormat::Int;
        let spec = hound::WavSpec { channels, sample_rate, bits_per_sample: bits, sample_format: format };
        let mut file = Cursor::new(Vec::new());
        let mut writer = hound::WavWriter::new(&mut file, spec).unwrap();
        for &s in &samples {
            writer.write_sample(s).unwrap();
        }
        writer.finalize().unwrap();
        let got = read_file(file.into_inner()).unwrap();
        let full = (1u64 << (bits - 1)) as f32;
        let expected: Vec<f32> = samples.iter().map(|&s| s as f32 / full).collect();
        prop_assert_eq!(got.samples, expected);
        prop_assert_eq!((got.channels, got.sample_rate), (channels.into(), sample_rate));
        prop_assert!(got.report.repairs.is_empty());
    }
}

#[test]
fn every_code_of_the_companded_encodings_is_read() {
    // Decoding is a table; its values are checked beside it. Here: each byte is one sample.
    let data: Vec<u8> = (0..=255).collect();
    for tag in [tag::ALAW, tag::MULAW] {
        let wav = Wav { tag, bits: 8, data: data.clone(), ..Wav::pcm16(1, &[]) };
        let got = read_file(wav.bytes()).unwrap();
        // Codes with the top bit set are positive in both laws.
        assert_eq!(got.samples.len(), 256);
        assert!(got.samples[..128].iter().all(|&y| y <= 0.0));
        assert!(got.samples[128..].iter().all(|&y| y >= 0.0));
    }
}

#[test]
fn non_finite_samples_pass_through() {
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.5];
    let data = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let wav = Wav { tag: tag::FLOAT, bits: 32, data, ..Wav::pcm16(1, &[]) };
    let got = read_file(wav.bytes()).unwrap().samples;
    let bits = |x: &[f32]| x.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&got), bits(&values));
}
