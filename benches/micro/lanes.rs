//! The lane kernels against realfft: one iteration is 16 slots.

use corsmal_dsp::lanes::{LaneFft, Row, Slots, gather, power_to_decibel};
use corsmal_dsp::mel::{MelParams, SparseBank, mel_filter};
use divan::{Bencher, counter::ItemsCount};
use realfft::RealFftPlanner;

fn main() {
    divan::main();
}

const SIZES: [usize; 4] = [512, 1024, 2048, 4096];

fn rows(n: usize) -> Vec<Row> {
    (0..n).map(|i| Row(std::array::from_fn(|s| ((i * 31 + s * 17) % 101) as f32 - 50.0))).collect()
}

#[divan::bench(args = SIZES)]
fn lane_power(bencher: Bencher, n: usize) {
    let plan = LaneFft::new(n).unwrap();
    let mut power = vec![Row::ZERO; plan.n_bins()];
    let source = rows(n);
    let mut work = source.clone();
    bencher.counter(ItemsCount::new(16usize)).bench_local(|| {
        work.copy_from_slice(&source);
        plan.power(&mut work, &mut power);
    });
}

#[divan::bench(args = SIZES)]
fn realfft_16(bencher: Bencher, n: usize) {
    let fft = RealFftPlanner::<f32>::new().plan_fft_forward(n);
    let source: Vec<f32> = (0..n).map(|i| (i % 101) as f32).collect();
    let (mut x, mut y, mut s) =
        (fft.make_input_vec(), fft.make_output_vec(), fft.make_scratch_vec());
    bencher.counter(ItemsCount::new(16usize)).bench_local(|| {
        for _ in 0..16 {
            x.copy_from_slice(&source);
            fft.process_with_scratch(&mut x, &mut y, &mut s).unwrap();
        }
    });
}

#[divan::bench(args = [1, 2, 6, 8])]
fn gather_2048(bencher: Bencher, channels: usize) {
    let signal = vec![0.5_f32; channels * (2048 + 512 * 16)];
    let window = vec![0.5_f32; 2048];
    let mut out = vec![Row::ZERO; 2048];
    let slots = Slots { first: 0, len: 16, channels };
    bencher
        .counter(ItemsCount::new(16usize))
        .bench_local(|| gather(&signal, 512, &window, slots, &mut out));
}

#[divan::bench]
fn decibel_128(bencher: Bencher) {
    let source = rows(128);
    let mut work = source.clone();
    bencher.counter(ItemsCount::new(16usize)).bench_local(|| {
        work.copy_from_slice(&source);
        power_to_decibel(&mut work, 1e-10, 0.0);
    });
}

#[divan::bench]
fn mel_128(bencher: Bencher) {
    let bank = SparseBank::new(&mel_filter(&MelParams::new(44100.0, 2048)).unwrap());
    let power = rows(1025);
    let mut mel = vec![Row::ZERO; 128];
    bencher.counter(ItemsCount::new(16usize)).bench_local(|| bank.apply_rows(&power, &mut mel));
}
