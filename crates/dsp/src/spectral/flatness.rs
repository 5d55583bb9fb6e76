//! Spectral flatness (librosa 0.11 `feature.spectral_flatness`).

use ndarray::Array3;

use super::Spectra;
use crate::error::{DspError, Result};
use crate::real::Real;
use crate::sums;

/// Parameters of the flatness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flatness {
    /// Floor of the powers.
    pub amin: f64,
    /// Exponent that makes powers of magnitudes.
    pub power: f64,
}

impl Default for Flatness {
    fn default() -> Self {
        Self { amin: 1e-10, power: 2.0 }
    }
}

impl Flatness {
    /// Refuses a floor that is not positive.
    pub fn check(&self) -> Result<()> {
        if self.amin > 0.0 {
            Ok(())
        } else {
            Err(DspError::parameter("amin", self.amin, "above 0"))
        }
    }

    /// Geometric over arithmetic mean of the powers of one spectrum: 1 for white noise and
    /// silence, towards 0 for tones. Both means are taken in double precision.
    pub fn of<T: Real>(&self, magnitude: &[T]) -> T {
        let amin = T::of(self.amin);
        let floored = |s: T| {
            let power = if self.power == 2.0 {
                s * s
            } else if self.power == 1.0 {
                s
            } else {
                s.powf(T::of(self.power))
            };
            // Written so that NaN stays NaN.
            if power < amin { amin.wide() } else { power.wide() }
        };
        let n = magnitude.len() as f64;
        // One logarithm for four factors, where their product keeps full precision.
        let groups = magnitude.chunks_exact(4);
        let mut logs: f64 = groups.remainder().iter().map(|s| floored(*s).ln()).sum();
        for group in groups {
            let product = group.iter().fold(1.0, |p, s| p * floored(*s));
            logs += if product.is_normal() {
                product.ln()
            } else {
                group.iter().map(|s| floored(*s).ln()).sum()
            };
        }
        T::of((logs / n).exp() / (sums::sum(magnitude, floored) / n))
    }
}

/// Flatness of every frame, `[channels, 1, frames]`.
///
/// # Errors
/// `amin <= 0`, negative magnitudes, or no bins.
pub fn spectral_flatness<'a, T: Real>(
    s: impl Into<Spectra<'a, T>>,
    params: Flatness,
) -> Result<Array3<T>> {
    let s = s.into();
    params.check()?;
    s.require_non_negative()?;
    let (channels, bins, frames) = s.dim();
    if bins == 0 {
        let expected = "at least one bin".into();
        return Err(DspError::Shape { name: "S", expected, actual: vec![channels, bins, frames] });
    }
    Ok(s.map(1, || (), |(), _, _, magnitude, out| out[0] = params.of(magnitude)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_spectra_are_flat_at_any_level() {
        let flatness = Flatness::default();
        for level in [0.0, 1e-30, 1e-4, 1.0, 1e18] {
            assert!((flatness.of(&[level; 7]) - 1.0_f32).abs() < 1e-6, "{level}");
        }
        for level in [1e-200, 1e-4, 1e150] {
            assert!((flatness.of(&[level; 7]) - 1.0_f64).abs() < 1e-12, "{level}");
        }
    }

    #[test]
    fn geometric_over_arithmetic() {
        let got = Flatness { amin: 1e-10, power: 1.0 }.of(&[1.0_f64, 2.0, 4.0, 8.0, 16.0]);
        assert!((got - 4.0 / 6.2).abs() < 1e-12);
    }
}
