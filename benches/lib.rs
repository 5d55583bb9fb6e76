//! Signals for the benchmarks in `micro/`. `cargo bench -p corsmal-benches` runs them.

/// Sample rate in Hz.
pub const RATE: u32 = 44_100;

/// `seconds` of interleaved noise with a tone in it, the same for every run.
pub fn signal(seconds: usize, channels: usize) -> Vec<f32> {
    let mut state = 0x2545_f491_u32;
    (0..seconds * RATE as usize * channels)
        .map(|i| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            let noise = state as f32 / u32::MAX as f32 - 0.5;
            let time = (i / channels) as f32 / RATE as f32;
            0.2 * noise + 0.3 * (std::f32::consts::TAU * 440.0 * time).sin()
        })
        .collect()
}
