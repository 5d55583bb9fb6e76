//! Spectral centroid (librosa 0.11 `feature.spectral_centroid`).

use ndarray::Array3;

use super::{Frequencies, Spectra};
use crate::error::Result;
use crate::normalize::Norm;
use crate::real::Real;
use crate::sums;

/// Mean frequency in Hz of one spectrum, weighted by its magnitudes; 0 for silence.
///
/// The weights are rounded to `T` after normalisation, as librosa stores them.
pub fn centroid<T: Real>(magnitude: &[T], freqs: &[f64]) -> f64 {
    let total = Norm::P(1.0).divisor(magnitude);
    sums::sum_pairs(magnitude, freqs, |s, f| T::of(s.wide() / total).wide() * f)
}

/// Centroid in Hz of every frame, `[channels, 1, frames]`.
///
/// # Errors
/// Negative or non-finite magnitudes, or frequencies that do not fit.
pub fn spectral_centroid<'a, T: Real>(
    s: impl Into<Spectra<'a, T>>,
    freqs: Frequencies,
) -> Result<Array3<f64>> {
    let s = s.into();
    freqs.check(s.dim())?;
    s.require_magnitudes()?;
    Ok(s.map(1, Vec::new, |buffer, c, t, magnitude, out| {
        out[0] = centroid(magnitude, freqs.column(c, t, buffer));
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_line_is_its_own_centroid() {
        let mut magnitude = [0.0_f32; 9];
        magnitude[3] = 0.25;
        let freqs: Vec<f64> = (0..9).map(|k| 100.0 * f64::from(k)).collect();
        assert_eq!(centroid(&magnitude, &freqs), 300.0);
        magnitude[5] = 0.25;
        assert_eq!(centroid(&magnitude, &freqs), 400.0);
    }
}
