//! Rates and arrays that can be converted.

use crate::error::{DspError, Result};

/// The largest ratio of two rates in either direction.
const MAX_RATIO: f64 = 65536.0;

pub(super) fn check_rates(orig_sr: f64, target_sr: f64) -> Result<()> {
    for (name, value) in [("orig_sr", orig_sr), ("target_sr", target_sr)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(DspError::parameter(name, value, "a positive rate in Hz"));
        }
    }
    let ratio = target_sr / orig_sr;
    if !(1.0 / MAX_RATIO..=MAX_RATIO).contains(&ratio) {
        let allowed = format!("within a factor of {MAX_RATIO} of orig_sr ({orig_sr})");
        return Err(DspError::parameter("target_sr", target_sr, allowed));
    }
    Ok(())
}

pub(super) fn check_interleaved(channels: usize, input: &[f32]) -> Result<()> {
    if channels == 0 || !input.len().is_multiple_of(channels) {
        return Err(DspError::Shape {
            name: "input",
            expected: format!("whole frames of {channels} channels"),
            actual: vec![input.len()],
        });
    }
    Ok(())
}
