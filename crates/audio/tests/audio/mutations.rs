//! Hostile bytes: mutated files must end in samples or an error, never in a panic, and within
//! bounded memory. `CORSMAL_MUTATIONS=50000000 cargo test -p corsmal-audio mutated` runs longer.

use std::io::Cursor;

use corsmal_audio::{BlockSource, SampleEncoding, from_reader, from_seekable};

use crate::allocations::measured;
use crate::common::{Wav, tag};
use crate::containers;

/// Largest memory that reading hostile PCM may take: the buffer and small change.
const PCM_BYTES: usize = 256 << 10;
/// Frames per block of the test reads.
const BLOCK: [usize; 2] = [64, 7];

/// splitmix64: a deterministic sequence of numbers.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// Changes a few places of `bytes`, most of them near the start where the headers are.
fn mutate(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Random) {
    const FIELDS: [u32; 10] =
        [0, 1, 2, 3, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0xffff_fffe, 0xffff, 0x10_0000];
    for _ in 0..=random.below(6) {
        if bytes.is_empty() {
            return;
        }
        let near = [80, 80, 640, bytes.len()][random.below(4)];
        let at = random.below(near.min(bytes.len()));
        match random.below(9) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 => {
                bytes.insert(at, random.next() as u8);
            }
            3 => {
                bytes.remove(at);
            }
            4 => bytes.truncate(at + random.below(bytes.len())),
            5 | 6 => {
                let field = FIELDS[random.below(FIELDS.len())].to_le_bytes();
                let width = [1, 2, 4][random.below(3)];
                for (to, from) in bytes[at..].iter_mut().zip(&field[..width]) {
                    *to = *from;
                }
            }
            7 => {
                let piece = bytes[at..(at + random.below(40)).min(bytes.len())].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            _ => {
                let other = &seeds[random.below(seeds.len())];
                let from = random.below(other.len());
                bytes.splice(at.., other[from..].iter().copied());
            }
        }
    }
}

/// Reads to the end; the number of frames and a checksum of their bits, or nothing on refusal.
fn drain(source: &mut dyn BlockSource, frames: usize) -> Option<(u64, u64)> {
    let channels = usize::from(source.spec().channels);
    let mut block = [0.0; 64 * 64];
    let block = &mut block[..frames * channels];
    let (mut total, mut sum) = (0, 0u64);
    loop {
        let n = source.read(block).ok()?;
        if n == 0 {
            assert_eq!(source.health().decoded_frames, total);
            return Some((total, sum));
        }
        total += n as u64;
        for y in &block[..n * channels] {
            sum = sum.rotate_left(5) ^ u64::from(y.to_bits());
        }
    }
}

fn count(default: usize) -> usize {
    let count = std::env::var("CORSMAL_MUTATIONS").ok().and_then(|n| n.parse().ok());
    count.unwrap_or(default)
}

/// WAV and the other containers of samples that stand side by side.
fn pcm_seeds() -> Vec<Vec<u8>> {
    let plain = Wav::pcm16(2, &[1, -2, 3, -4, 5, -6, 7, -8]);
    let long =
        Wav { form: b"RF64", data_size: Some(u32::MAX), long_size: Some(16), ..plain.clone() };
    let chunks = vec![(*b"junk", 3, b"abc".to_vec()), (*b"LIST", 4, b"INFO".to_vec())];
    let all = [
        plain.clone(),
        Wav { form: b"RIFX", ..plain.clone() },
        Wav { before: chunks, after: b"LIST\x04\0\0\0abcd".to_vec(), ..plain.clone() },
        Wav { sub_format: Some(tag::PCM), bits: 24, ..plain.clone() },
        Wav { sub_format: Some(tag::FLOAT), bits: 32, ..plain.clone() },
        Wav { tag: tag::FLOAT, bits: 64, ..plain.clone() },
        Wav { tag: tag::MULAW, bits: 8, channels: 3, ..plain.clone() },
        Wav { data_size: Some(0), ..plain },
        long,
    ];
    all.iter().map(Wav::bytes).chain(containers::seeds()).collect()
}

#[test]
fn mutated_files_of_pcm_neither_panic_nor_allocate() {
    let seeds = pcm_seeds();
    let mut random = Random(1);
    let (mut accepted, mut total) = (0, 0);
    for _ in 0..count(100_000) {
        let mut bytes = seeds[random.below(seeds.len())].clone();
        mutate(&mut bytes, &seeds, &mut random);
        let len = bytes.len() as u64;
        let (file, pipe) = (Cursor::new(bytes.clone()), Cursor::new(bytes));
        // Noise can be a frame of MPEG audio, which has limits of its own.
        let lossy = |s: &dyn BlockSource| s.spec().encoding == SampleEncoding::Lossy;
        if from_seekable(file.clone()).is_ok_and(|source| lossy(source.as_ref())) {
            continue;
        }
        let ((whole, split, piped), peak, _) = measured(|| {
            let whole = from_seekable(file.clone()).ok().map(|mut s| drain(s.as_mut(), BLOCK[0]));
            let split = from_seekable(file).ok().map(|mut s| drain(s.as_mut(), BLOCK[1]));
            let piped = from_reader(pipe).ok().map(|mut s| drain(s.as_mut(), BLOCK[0]));
            (whole, split, piped)
        });
        // Bytes are in memory: reading them cannot fail, and no frame comes from nowhere.
        assert!(whole != Some(None) && piped != Some(None));
        assert_eq!(whole, split);
        assert!(whole.flatten().is_none_or(|(frames, _)| frames <= len));
        assert!(peak < PCM_BYTES, "{peak} bytes");
        accepted += usize::from(whole.is_some());
        total += 1;
    }
    println!("{total} mutants, {accepted} accepted");
    assert!(accepted > total / 20, "the mutator destroys too much: {accepted} of {total}");
    assert!(accepted < total, "the mutator changes too little");
}

#[cfg(feature = "symphonia")]
#[test]
fn mutated_compressed_files_do_not_panic() {
    use crate::compressed::{BLOCKS, LEVELS, SAMPLES};
    use crate::mp4;

    /// Decoders allocate by what headers say, up to their own limits.
    const BYTES: usize = 64 << 20;

    let adpcm: [&[u8]; 2] =
        [include_bytes!("samples/sines-2ch-ima.wav"), include_bytes!("samples/sines-2ch-ms.wav")];
    let mp4 = [mp4::AAC, mp4::M4A, mp4::FRAGMENTS, mp4::ALAC];
    let all = [&SAMPLES[..], &LEVELS, &adpcm, &mp4, &[BLOCKS]].concat();
    let mut seeds: Vec<Vec<u8>> = all.iter().map(|s| s.to_vec()).collect();
    seeds.extend(mp4::seeds());
    let mut random = Random(2);
    let (mut accepted, mut worst, mut total) = (0, 0, 0);
    for _ in 0..count(100_000) / 100 {
        let mut bytes = seeds[random.below(seeds.len())].clone();
        mutate(&mut bytes, &seeds, &mut random);
        let file = Cursor::new(bytes);
        let (frames, peak, _) = measured(|| {
            let file = file.clone();
            from_seekable(file).ok().and_then(|mut source| drain(source.as_mut(), BLOCK[0]))
        });
        // Pipes and other blocks give the same samples.
        let pipe = from_reader(file).ok().and_then(|mut source| drain(source.as_mut(), BLOCK[1]));
        assert_eq!(frames, pipe);
        accepted += usize::from(frames.is_some());
        worst = worst.max(peak);
        total += 1;
    }
    println!("{total} mutants, {accepted} read to their end, {worst} bytes at most");
    assert!(worst < BYTES, "{worst} bytes");
    assert!(accepted > 0 && accepted < total);
}

#[test]
fn reading_blocks_does_not_allocate() {
    let bytes = Wav::pcm16(8, &[123; 8 * 50_000]).bytes();
    let mut source = from_seekable(Cursor::new(bytes)).unwrap();
    let mut block = vec![0.0; 8 * 1000];
    let (frames, _, calls) = measured(|| {
        let mut frames = 0;
        for _ in 0..49 {
            frames += source.read(&mut block).unwrap();
        }
        frames
    });
    assert_eq!((frames, calls), (49_000, 0));
}
