//! Normalisation of vectors to unit length (librosa 0.11 `util.normalize`).

use crate::error::{DspError, Result};
use crate::real::Real;
use crate::sums;

/// How the length of a vector is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Norm {
    /// Largest magnitude (`numpy.inf`).
    Max,
    /// Smallest magnitude (`-numpy.inf`).
    Min,
    /// Number of non-zero values (0).
    Count,
    /// `(sum |x|^p)^(1/p)` for `p > 0`.
    P(f64),
}

impl TryFrom<f64> for Norm {
    type Error = DspError;

    /// librosa's number for a norm: `inf`, `-inf`, 0 or `p > 0`.
    fn try_from(p: f64) -> Result<Self> {
        if p == f64::INFINITY {
            Ok(Self::Max)
        } else if p == f64::NEG_INFINITY {
            Ok(Self::Min)
        } else if p == 0.0 {
            Ok(Self::Count)
        } else if p > 0.0 {
            Ok(Self::P(p))
        } else {
            Err(DspError::parameter("norm", p, "inf, -inf, 0 or a positive number"))
        }
    }
}

impl Norm {
    /// Length of `values`, measured in double precision.
    pub fn length<T: Real>(self, values: &[T]) -> f64 {
        let magnitude = |x: T| x.wide().abs();
        match self {
            Self::Max => values.iter().fold(0.0, |m, x| magnitude(*x).max(m)),
            Self::Min => values.iter().fold(f64::INFINITY, |m, x| magnitude(*x).min(m)),
            Self::Count => values.iter().filter(|x| **x != T::zero()).count() as f64,
            Self::P(1.0) => sums::sum(values, magnitude),
            Self::P(2.0) => sums::sum(values, |x| x.wide() * x.wide()).sqrt(),
            Self::P(p) => sums::sum(values, |x| magnitude(x).powf(p)).powf(1.0 / p),
        }
    }

    /// What `values` are to be divided by: their length, or 1 where that is below the smallest
    /// normal number of `T`, so that silence stays silence.
    pub fn divisor<T: Real>(self, values: &[T]) -> f64 {
        let length = self.length(values);
        if length < T::min_positive_value().wide() { 1.0 } else { length }
    }

    /// Divides `values` by their [`divisor`](Self::divisor).
    pub fn normalize<T: Real>(self, values: &mut [T]) {
        let divisor = self.divisor(values);
        for x in values {
            *x = T::of(x.wide() / divisor);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths() {
        let x = [3.0_f32, -4.0, 0.0];
        let of = |p: f64| Norm::try_from(p).unwrap().length(&x);
        assert_eq!([of(f64::INFINITY), of(f64::NEG_INFINITY), of(0.0)], [4.0, 0.0, 2.0]);
        assert_eq!([of(1.0), of(2.0)], [7.0, 5.0]);
        assert!((of(3.0) - 91.0_f64.cbrt()).abs() < 1e-12);
        assert!(Norm::try_from(-1.0).is_err() && Norm::try_from(f64::NAN).is_err());
    }

    #[test]
    fn silence_stays_silence() {
        for norm in [Norm::Max, Norm::Min, Norm::Count, Norm::P(2.0)] {
            let mut x = [0.0_f32; 12];
            norm.normalize(&mut x);
            assert_eq!(x, [0.0; 12]);
        }
    }
}
