//! Transforms and filters behind the whole-recording features: one iteration is 2 s of one channel.

use std::sync::Arc;

use corsmal_benches::{RATE, signal};
use corsmal_dsp::corsmal::paa::PaaPlan;
use corsmal_dsp::cqt::{CqtParams, CqtPlan};
use corsmal_dsp::hpss::{HpssParams, Part, Separator, Work};
use corsmal_dsp::median;
use corsmal_dsp::resample::{ResamplePlan, ResampleStream};
use corsmal_dsp::stft::StftParams;
use divan::Bencher;
use ndarray::{Array2, ArrayView1};

fn main() {
    divan::main();
}

const SECONDS: usize = 2;
/// Frames of 2 s, and bins.
const SPECTROGRAM: (usize, usize) = (173, 1025);

fn magnitudes() -> Array2<f32> {
    let values = signal(SECONDS + 3, 1);
    Array2::from_shape_fn(SPECTROGRAM, |(t, k)| values[t * SPECTROGRAM.1 + k].abs())
}

#[divan::bench(args = [31, 17])]
fn median_along_time(bencher: Bencher, size: usize) {
    let x = magnitudes();
    let mut out = Array2::zeros(x.dim());
    bencher.bench_local(|| median::down(x.view(), size, 0..x.nrows(), out.view_mut()));
}

#[divan::bench(args = [31, 17])]
fn median_along_frequency(bencher: Bencher, size: usize) {
    let x = magnitudes();
    let mut out = Array2::zeros(x.dim());
    bencher.bench_local(|| median::across(x.view(), size, out.view_mut()));
}

#[divan::bench]
fn harmonic_part(bencher: Bencher) {
    let stft = StftParams::new(2048, 512);
    let separator = Separator::new(&stft, HpssParams::default(), false).unwrap();
    let y = signal(SECONDS, 1);
    let (mut out, mut work) = (vec![0.0; y.len()], Work::default());
    bencher.bench_local(|| {
        let mut parts = [(Part::Harmonic, &mut out[..])];
        separator.separate(&y, &mut parts, &mut work, |_| {}).unwrap();
    });
}

#[divan::bench(args = [12, 36])]
fn constant_q(bencher: Bencher, bins_per_octave: usize) {
    let sr = f64::from(RATE);
    let n_bins = 7 * bins_per_octave;
    let plan = CqtPlan::new(&CqtParams { n_bins, bins_per_octave, ..CqtParams::new(sr) }).unwrap();
    let y = signal(SECONDS, 1);
    bencher.bench_local(|| plan.transform(&y).unwrap());
}

#[divan::bench(args = [2205, 1024])]
fn paa_short_term(bencher: Bencher, window: usize) {
    let plan = PaaPlan::new(f64::from(RATE), window, window).unwrap();
    let y = signal(SECONDS, 1);
    bencher.bench_local(|| plan.short_term(ArrayView1::from(&y), true).unwrap());
}

#[divan::bench(args = [22_050, 16_000, 48_000])]
fn resample(bencher: Bencher, target: u32) {
    let plan = Arc::new(ResamplePlan::new(f64::from(RATE), f64::from(target)).unwrap());
    let y = signal(SECONDS, 1);
    bencher.bench_local(|| {
        let mut out = Vec::new();
        let mut stream = ResampleStream::new(plan.clone(), 1).unwrap();
        stream.push(&y, &mut out).unwrap();
        stream.finish(&mut out);
        out
    });
}
