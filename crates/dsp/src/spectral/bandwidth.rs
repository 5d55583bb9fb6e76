//! Spectral bandwidth (librosa 0.11 `feature.spectral_bandwidth`).

use ndarray::{Array3, ArrayView2};

use super::{Frequencies, Spectra, centroid};
use crate::error::{DspError, Result};
use crate::normalize::Norm;
use crate::real::Real;
use crate::sums;

/// Parameters of the bandwidth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bandwidth {
    /// Power of the deviation from the centroid.
    pub p: f64,
    /// Magnitudes are divided by their sum first.
    pub norm: bool,
}

impl Default for Bandwidth {
    fn default() -> Self {
        Self { p: 2.0, norm: true }
    }
}

impl Bandwidth {
    /// Refuses powers that are not positive.
    pub fn check(&self) -> Result<()> {
        if self.p.is_finite() && self.p > 0.0 {
            Ok(())
        } else {
            Err(DspError::parameter("p", self.p, "above 0"))
        }
    }

    /// `(sum S |f - centroid|^p)^(1/p)` of one spectrum, in Hz when normalised.
    pub fn of<T: Real>(&self, magnitude: &[T], freqs: &[f64], centroid: f64) -> f64 {
        let total = if self.norm { Norm::P(1.0).divisor(magnitude) } else { 1.0 };
        let weight = |s: T| T::of(s.wide() / total).wide();
        if self.p == 2.0 {
            let square = |x: f64| x * x;
            sums::sum_pairs(magnitude, freqs, |s, f| weight(s) * square(f - centroid)).sqrt()
        } else {
            let power = |x: f64| x.abs().powf(self.p);
            sums::sum_pairs(magnitude, freqs, |s, f| weight(s) * power(f - centroid))
                .powf(1.0 / self.p)
        }
    }
}

/// Bandwidth of every frame, `[channels, 1, frames]`, around the given centroids
/// `[channels, frames]` or the frames' own.
///
/// # Errors
/// Negative or non-finite magnitudes, an impossible power, frequencies or centroids that do not fit.
pub fn spectral_bandwidth<'a, T: Real>(
    s: impl Into<Spectra<'a, T>>,
    freqs: Frequencies,
    centroids: Option<ArrayView2<f64>>,
    params: Bandwidth,
) -> Result<Array3<f64>> {
    let s = s.into();
    params.check()?;
    freqs.check(s.dim())?;
    let (channels, _, frames) = s.dim();
    if params.norm || centroids.is_none() {
        s.require_magnitudes()?;
    } else {
        s.require_non_negative()?;
    }
    if let Some(given) = centroids.filter(|given| given.dim() != (channels, frames)) {
        let expected = format!("[{channels}, {frames}]");
        return Err(DspError::Shape { name: "centroid", expected, actual: given.shape().to_vec() });
    }
    Ok(s.map(1, Vec::new, |buffer, c, t, magnitude, out| {
        let freqs = freqs.column(c, t, buffer);
        let middle = centroids.map_or_else(|| centroid(magnitude, freqs), |given| given[[c, t]]);
        out[0] = params.of(magnitude, freqs, middle);
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_equal_lines_are_half_their_distance_wide() {
        let mut magnitude = [0.0_f64; 9];
        (magnitude[2], magnitude[6]) = (0.5, 0.5);
        let freqs: Vec<f64> = (0..9).map(|k| 100.0 * f64::from(k)).collect();
        for p in [1.0, 2.0, 3.0] {
            let width = Bandwidth { p, norm: true }.of(&magnitude, &freqs, 400.0);
            assert!((width - 200.0).abs() < 1e-9, "{p}: {width}");
        }
        assert!(Bandwidth { p: 0.0, norm: true }.check().is_err());
    }
}
