//! Spectral roll-off (librosa 0.11 `feature.spectral_rolloff`).

use ndarray::Array3;

use super::{Frequencies, Spectra};
use crate::error::{DspError, Result};
use crate::real::Real;

/// Lowest frequency in Hz at or below which `roll_percent` (a fraction) of the magnitudes lie.
///
/// The running sum is kept in `T` and in bin order, as librosa's `cumsum`: its rounding decides
/// which of two neighbouring bins is found. `sums` is working memory.
pub fn rolloff<T: Real>(
    magnitude: &[T],
    freqs: &[f64],
    roll_percent: f64,
    sums: &mut Vec<T>,
) -> f64 {
    sums.clear();
    let mut sum = T::zero();
    sums.extend(magnitude.iter().map(|s| {
        sum += *s;
        sum
    }));
    let threshold = T::of(roll_percent) * sum;
    // The running sum never falls, so all bins from here on qualify.
    let reached = sums.partition_point(|sum| *sum < threshold);
    freqs[reached..].iter().fold(f64::NAN, |low, f| low.min(*f))
}

/// Roll-off frequency in Hz of every frame, `[channels, 1, frames]`.
///
/// # Errors
/// A fraction outside (0, 1), negative magnitudes, or frequencies that do not fit.
pub fn spectral_rolloff<'a, T: Real>(
    s: impl Into<Spectra<'a, T>>,
    freqs: Frequencies,
    roll_percent: f64,
) -> Result<Array3<f64>> {
    if !(roll_percent > 0.0 && roll_percent < 1.0) {
        return Err(DspError::parameter("roll_percent", roll_percent, "between 0 and 1"));
    }
    let s = s.into();
    freqs.check(s.dim())?;
    s.require_non_negative()?;
    let state = || (Vec::new(), Vec::new());
    Ok(s.map(1, state, |(buffer, sums), c, t, magnitude, out| {
        out[0] = rolloff(magnitude, freqs.column(c, t, buffer), roll_percent, sums);
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_below_the_fraction_are_passed() {
        let freqs: Vec<f64> = (0..10).map(|k| 10.0 * f64::from(k)).collect();
        assert_eq!(rolloff(&[1.0_f32; 10], &freqs, 0.5, &mut Vec::new()), 40.0);
        assert_eq!(rolloff(&[1.0_f32; 10], &freqs, 0.99, &mut Vec::new()), 90.0);
        assert_eq!(rolloff(&[0.0_f32; 10], &freqs, 0.85, &mut Vec::new()), 0.0);
    }

    #[test]
    fn unsorted_frequencies_give_the_lowest_that_qualifies() {
        assert_eq!(
            rolloff(&[1.0_f64, 1.0, 1.0, 1.0], &[0.0, 50.0, 30.0, 40.0], 0.5, &mut Vec::new()),
            30.0
        );
    }
}
