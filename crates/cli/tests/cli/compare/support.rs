//! Running the command on files made here.

use std::path::{Path, PathBuf};
use std::process::Output;

use corsmal_files::npz::{Compression, NpzWriter};
use ndarray::Array3;
use serde_json::Value;

use crate::command::run;

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Decibels of 3 channels, 40 coefficients, 60 frames: none like another, from -60 to 0 dB.
pub fn levels() -> Array3<f32> {
    let mut state = 7u64;
    Array3::from_shape_simple_fn((3, 40, 60), || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        -0.5 - 59.0 * ((state >> 33) as f32 / (1u64 << 31) as f32)
    })
}

/// The same as powers.
pub fn powers() -> Array3<f32> {
    levels().mapv(|v| 10f32.powf(v / 10.0))
}

pub fn npz(path: &Path, arrays: &[(&str, &Array3<f32>)]) {
    let mut writer = NpzWriter::create(path, Compression::Deflated).unwrap();
    for (name, values) in arrays {
        let (c, k, t) = values.dim();
        let values: Vec<f32> = values.iter().copied().collect();
        writer.floats(name, &[c, k, t], &values).unwrap();
    }
    writer.finish().unwrap();
}

pub struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn run(&self, a: &str, b: &str, more: &[&str]) -> Output {
        let (a, b) = (self.path(a), self.path(b));
        let mut args = vec!["compare", a.to_str().unwrap(), b.to_str().unwrap()];
        args.extend(more);
        run(&args)
    }

    pub fn json(&self, a: &str, b: &str, more: &[&str]) -> Value {
        let out = self.run(a, b, &[more, &["--json"]].concat());
        assert!(out.stderr.is_empty(), "{}", text(&out.stderr));
        serde_json::from_slice(&out.stdout).unwrap()
    }
}

/// Two channels of noise and a chirp, a second at 16 kHz; the second channel is 30 dB lower.
pub fn recording(path: &Path, seed: u64) {
    let spec = hound::WavSpec {
        channels: 2,
        sample_rate: 16_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    let mut state = seed;
    for t in 0..16_000 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
        let noise = (state >> 40) as f64 / (1u64 << 24) as f64 - 0.5;
        let s = t as f64 / 16_000.0;
        let chirp = (std::f64::consts::TAU * (200.0 + 1500.0 * s) * s).sin();
        let sample = 8000.0 * chirp + 600.0 * noise;
        writer.write_sample(sample as i16).unwrap();
        writer.write_sample((sample / 32.0) as i16).unwrap();
    }
    writer.finalize().unwrap();
}

/// Features of two recordings, with these arguments.
pub fn extract(files: &Files, out: &str, more: &[&str]) {
    let audio = files.path("audio");
    if !audio.is_dir() {
        std::fs::create_dir(&audio).unwrap();
        recording(&audio.join("one.wav"), 1);
        recording(&audio.join("two.wav"), 2);
    }
    let out = files.path(out);
    let mut args = vec!["extract", "--in", audio.to_str().unwrap(), "--out", out.to_str().unwrap()];
    args.extend(more);
    let ended = run(&args);
    assert!(ended.status.success(), "{}", text(&ended.stderr));
}
