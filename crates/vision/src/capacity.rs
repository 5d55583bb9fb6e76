//! What a capacity can be.

use std::ops::RangeInclusive;

use crate::error::{Result, VisionError};

/// Capacities of containers in mL, with room: a length in another unit changes them by a factor of 1000. Boxes
/// around all points of synthetic depth images, the least exact method, reach 36 L.
const POSSIBLE: RangeInclusive<f64> = 1.0..=100_000.0;

/// A capacity in mL that a container can have.
pub(crate) fn possible(capacity: f64) -> Result<f64> {
    if POSSIBLE.contains(&capacity) {
        return Ok(capacity);
    }
    Err(VisionError::Request(format!(
        "an estimate of {capacity:.3} mL, which is impossible for a container (1 mL to 100 L); depth must be in mm, \
         and the calibration in m"
    )))
}
