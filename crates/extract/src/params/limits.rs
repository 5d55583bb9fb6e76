//! Limits on parameters: they bound the memory that a configuration can ask for.

/// Longest transform; bounds the memory of windows and filter banks.
pub const MAX_N_FFT: usize = 1 << 18;
/// Longest frame of the waveform.
pub const MAX_FRAME: usize = 1 << 24;

/// Refuses values above `limit`.
pub fn at_most(name: &'static str, value: usize, limit: usize) -> corsmal_dsp::Result<()> {
    if value <= limit {
        return Ok(());
    }
    Err(corsmal_dsp::DspError::parameter(name, value, format!("at most {limit}")))
}

/// Rate in Hz by which coefficients are counted where the recordings give the rate.
pub const USUAL_RATE: f64 = 44_100.0;
