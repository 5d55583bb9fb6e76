//! Features as `extract` computes them, of 2 s in memory: what one second of every channel costs.

use std::sync::Arc;

use corsmal_benches::{RATE, signal};
use corsmal_extract::config::Config;
use corsmal_extract::engine::Signals;
use divan::{Bencher, counter::ItemsCount};

fn main() {
    divan::main();
}

const SECONDS: usize = 2;

fn extract(bencher: Bencher, toml: &str, channels: usize) {
    let config = Config::with_overrides(toml, "benchmark", &[]).unwrap();
    let signals = Signals::new(Arc::new(config));
    let samples = signal(SECONDS, channels);
    bencher.counter(ItemsCount::new(SECONDS * channels)).bench_local(|| {
        let mut signal = signals.start(RATE, channels as u16).unwrap();
        signal.push(&samples).unwrap();
        signal.finish().unwrap()
    });
}

const STREAMING: [&str; 7] = [
    "melspectrogram",
    "mfcc",
    "zero_crossing_rate",
    "rms",
    "spectral_centroid",
    "spectral_contrast",
    "onset_strength",
];

#[divan::bench(args = STREAMING)]
fn eight_channels(bencher: Bencher, name: &str) {
    extract(bencher, &format!("[features.{name}]"), 8);
}

#[divan::bench(args = ["melspectrogram", "mfcc", "zero_crossing_rate"])]
fn one_channel(bencher: Bencher, name: &str) {
    extract(bencher, &format!("[features.{name}]"), 1);
}

#[divan::bench(args = [512, 1024, 2048, 4096])]
fn mel_of_transforms(bencher: Bencher, n_fft: usize) {
    let hop = n_fft / 4;
    let toml = format!("[features.melspectrogram]\nn_fft = {n_fft}\nhop_length = {hop}\n");
    extract(bencher, &toml, 8);
}

const WHOLE: [&str; 6] =
    ["af193", "a34f136", "chroma_stft", "chroma_cqt", "m2_mfcc", "vggish_patches"];

#[divan::bench(args = WHOLE)]
fn whole_recording(bencher: Bencher, name: &str) {
    extract(bencher, &format!("[features.{name}]"), 1);
}
