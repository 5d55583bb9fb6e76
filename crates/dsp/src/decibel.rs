//! Decibels (librosa 0.11 `power_to_db`, `amplitude_to_db`).

use crate::error::{DspError, Result};
use crate::real::Real;

/// Reference, floor and range of a conversion to decibels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decibel {
    /// Value that becomes 0 dB.
    pub reference: f64,
    /// Smallest value that is told apart from zero.
    pub amin: f64,
    /// Range kept below the maximum, in dB; `None` keeps everything.
    pub top_db: Option<f64>,
}

impl Default for Decibel {
    /// librosa's `power_to_db` defaults.
    fn default() -> Self {
        Self { reference: 1.0, amin: 1e-10, top_db: Some(80.0) }
    }
}

impl Decibel {
    /// Refuses `amin <= 0` and `top_db < 0`.
    pub fn check(&self) -> Result<()> {
        if self.amin.is_nan() || self.amin <= 0.0 {
            return Err(DspError::parameter("amin", self.amin, "above 0"));
        }
        match self.top_db {
            Some(top_db) if top_db.is_nan() || top_db < 0.0 => {
                Err(DspError::parameter("top_db", top_db, "0 or more, or none"))
            }
            _ => Ok(()),
        }
    }

    /// `10 log10(max(amin, |ref|))`, subtracted from every value.
    pub fn offset(&self) -> f64 {
        10.0 * self.amin.max(self.reference.abs()).log10()
    }

    /// Power values to decibels in place. The `top_db` clamp takes its maximum over the whole
    /// slice, as librosa takes it over the whole array, channels included.
    ///
    /// # Errors
    /// `amin <= 0` or `top_db < 0`.
    pub fn power<T: Real>(&self, values: &mut [T]) -> Result<()> {
        self.check()?;
        let (amin, offset, ten) = (T::of(self.amin), T::of(self.offset()), T::of(10.0));
        let mut peak = T::neg_infinity();
        for v in values.iter_mut() {
            *v = ten * v.max(amin).log10() - offset;
            peak = peak.max(*v);
        }
        if let Some(top_db) = self.top_db {
            let floor = peak - T::of(top_db);
            values.iter_mut().for_each(|v| *v = v.max(floor));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_sits_at_the_floor() {
        let mut x = vec![0.0_f64; 4];
        Decibel::default().power(&mut x).unwrap();
        assert!(x.iter().all(|v| (v + 100.0).abs() < 1e-9));
    }

    #[test]
    fn the_clamp_is_joint() {
        let mut x = vec![1.0_f32, 1e-12, 1e-3];
        Decibel::default().power(&mut x).unwrap();
        assert_eq!(x[1], -80.0);
    }

    #[test]
    fn impossible_values_are_refused() {
        let mut x = [1.0_f32];
        assert!(Decibel { amin: 0.0, ..Decibel::default() }.power(&mut x).is_err());
        assert!(Decibel { top_db: Some(-1.0), ..Decibel::default() }.power(&mut x).is_err());
    }
}
