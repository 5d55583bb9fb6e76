//! Signals and features of them.

use std::path::PathBuf;
use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::engine::{Extractor, Features, Plan, Recording};
use ndarray::{Array2, Array3, ArrayView2, s};

pub const SR: f64 = 22_050.0;

/// Two tones over noise, another mixture in every channel, `[channels, n]`.
pub fn signal(channels: usize, n: usize) -> Array2<f32> {
    let mut state = 7_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    Array2::from_shape_fn((channels, n), |(c, i)| {
        let tone = |hz: f64| (std::f64::consts::TAU * hz * i as f64 / SR).sin() as f32;
        let level = 0.3 / (c + 1) as f32;
        level * tone(440.0 * (c + 1) as f64) + 0.1 * tone(1760.0) + 0.02 * noise()
    })
}

/// What a configuration gives of a signal that is pushed in blocks, or why it gives nothing.
pub fn features(
    config: &Arc<Config>,
    y: ArrayView2<f32>,
    sr: f64,
    block: usize,
) -> Result<Features, String> {
    let plan = Arc::new(Plan::new(config, sr, y.nrows()).map_err(|e| e.to_string())?);
    let interleaved: Vec<f32> = y.t().iter().copied().collect();
    let mut extractor = Extractor::new(plan.clone(), 0..u64::MAX, 0);
    interleaved.chunks(block * y.nrows()).for_each(|b| extractor.push(b));
    let mut recording = Recording::new(plan, &std::env::temp_dir());
    recording.add(extractor.finish(true).map_err(|e| e.to_string())?).unwrap();
    recording.finish().map_err(|e| e.to_string())
}

/// Frames of the last feature of a configuration, `[channels, coefficients, frames]`.
pub fn try_frames(toml: &str, y: ArrayView2<f32>, block: usize) -> Result<Array3<f32>, String> {
    let config = Arc::new(Config::with_overrides(toml, "test", &[]).unwrap());
    let Features::Frames(mut arrays) = features(&config, y, SR, block)? else {
        panic!("no summary was asked for")
    };
    let array = arrays.pop().unwrap();
    let shape = (array.frames, array.coefficients, y.nrows());
    let values = Array3::from_shape_vec(shape, array.values.into_vec().unwrap()).unwrap();
    Ok(values.reversed_axes())
}

/// The same where nothing can be wrong.
pub fn frames(toml: &str, y: ArrayView2<f32>, block: usize) -> Array3<f32> {
    try_frames(toml, y, block).unwrap()
}

/// A channel by itself, `[1, n]`.
pub fn alone(y: &Array2<f32>, c: usize) -> ArrayView2<'_, f32> {
    y.slice(s![c..c + 1, ..])
}

/// The shared material, where it is present.
pub fn shared() -> Option<PathBuf> {
    let root = std::env::var_os("CORSMAL_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let root = root.join("data");
    if root.is_dir() {
        return Some(root);
    }
    println!("skipped: {} is absent (CORSMAL_SHARED)", root.display());
    None
}
