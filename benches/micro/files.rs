//! Reading recordings and writing archives.

use std::io::Cursor;

use corsmal_benches::{RATE, signal};
use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzWriter};
use divan::{Bencher, counter::BytesCount};
use hound::{SampleFormat, WavSpec, WavWriter};

fn main() {
    divan::main();
}

const CHANNELS: u16 = 8;

/// 2 s as a WAV file.
fn wav(bits_per_sample: u16) -> Vec<u8> {
    let float = bits_per_sample == 32;
    let sample_format = if float { SampleFormat::Float } else { SampleFormat::Int };
    let spec = WavSpec { channels: CHANNELS, sample_rate: RATE, bits_per_sample, sample_format };
    let mut file = Cursor::new(Vec::new());
    let mut writer = WavWriter::new(&mut file, spec).unwrap();
    for x in signal(2, usize::from(CHANNELS)) {
        match float {
            true => writer.write_sample(x).unwrap(),
            false => writer.write_sample((x * (1 << (bits_per_sample - 1)) as f32) as i32).unwrap(),
        }
    }
    writer.finalize().unwrap();
    file.into_inner()
}

/// Bytes in memory to samples, opening included.
#[divan::bench(args = [8, 16, 24, 32])]
fn read_wav(bencher: Bencher, bits: u16) {
    let file = wav(bits);
    let mut block = vec![0.0; (1 << 13) * usize::from(CHANNELS)];
    bencher
        .counter(BytesCount::new(file.len()))
        .with_inputs(|| Cursor::new(file.clone()))
        .bench_local_values(|file| {
            let mut source = corsmal_audio::from_seekable(file).unwrap();
            while source.read(&mut block).unwrap() > 0 {}
        });
}

/// Sixteen arrays of 128 bands, 8 channels and 173 frames (2 s), headers and directory included.
#[divan::bench(args = [Compression::Stored, Compression::Deflated])]
fn write_npz(bencher: Bencher, compression: Compression) {
    const SHAPE: [usize; 3] = [8, 128, 173];
    let values: Vec<f32> = signal(1, 8)[..SHAPE.iter().product()].to_vec();
    let header = Header::new(DType::F32, &SHAPE).fortran();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.npz");
    bencher.counter(BytesCount::new(16 * 4 * values.len())).bench_local(|| {
        let mut writer = NpzWriter::create(&path, compression).unwrap();
        for i in 0..16 {
            writer.array(&i.to_string(), &header, bytemuck::cast_slice(&values)).unwrap();
        }
        writer.finish().unwrap();
        std::fs::remove_file(&path).unwrap();
    });
}
