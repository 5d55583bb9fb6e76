//! Spectral flatness (librosa 0.11 `feature.spectral_flatness`).

use ndarray::Array3;

use super::Spectra;
use crate::error::{DspError, Result};
use crate::lanes::logarithm;
use crate::real::Real;
use crate::simd::vectorized;
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
        let (blocks, rest) = magnitude.as_chunks::<{ FACTORS * LANES }>();
        vectorized(
            #[inline(always)]
            || {
                let mut logs: f64 = rest.iter().map(|s| floored(*s).ln()).sum();
                let (mut exponents, mut halves) = ([0.0; LANES], [0.0; LANES]);
                for block in blocks {
                    let mut products = [1.0; LANES];
                    for factors in block.as_chunks::<LANES>().0 {
                        products = std::array::from_fn(|l| products[l] * floored(factors[l]));
                    }
                    if !products.iter().fold(true, |normal, p| normal & p.is_normal()) {
                        logs += block.iter().map(|s| floored(*s).ln()).sum::<f64>();
                        continue;
                    }
                    for (l, product) in products.into_iter().enumerate() {
                        let (exponent, half) = logarithm(product);
                        exponents[l] += exponent;
                        halves[l] += half;
                    }
                }
                logs += exponents.iter().sum::<f64>() * std::f64::consts::LN_2;
                logs += 2.0 * halves.iter().sum::<f64>();
                T::of((logs / n).exp() / (sums::sum(magnitude, floored) / n))
            },
        )
    }
}

/// Logarithms that are taken together.
const LANES: usize = 8;

/// Factors of a product of which one logarithm is taken, where the product keeps full precision.
const FACTORS: usize = 4;

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
            assert!((flatness.of(&[level; 71]) - 1.0_f32).abs() < 1e-6, "{level}");
        }
        for level in [1e-200, 1e-4, 1e150] {
            assert!((flatness.of(&[level; 7]) - 1.0_f64).abs() < 1e-12, "{level}");
            assert!((flatness.of(&[level; 71]) - 1.0_f64).abs() < 1e-12, "{level}");
        }
    }

    #[test]
    fn geometric_over_arithmetic() {
        let values = [1.0_f64, 2.0, 4.0, 8.0, 16.0].repeat(20);
        let flatness = Flatness { amin: 1e-10, power: 1.0 };
        for values in [&values[..5], &values] {
            assert!((flatness.of(values) - 4.0 / 6.2).abs() < 1e-12);
        }
        // Products of four are no normal numbers here.
        let tiny: Vec<f64> = values.iter().map(|x| x * 1e-90).collect();
        let got = Flatness { amin: 1e-300, power: 1.0 }.of(&tiny);
        assert!((got - 4.0 / 6.2).abs() < 1e-12);
    }
}
