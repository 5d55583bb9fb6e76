//! Decibels (librosa 0.11 `power_to_db`, `amplitude_to_db`).

use rayon::prelude::*;

use crate::error::{DspError, Result};
use crate::lanes::{LANES, decibel, decibel_double};
use crate::real::{Real, part_finite};
use crate::simd::vectorized;

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
        10.0 * self.least().log10()
    }

    /// `max(amin, |ref|)`; NaN where the reference is.
    fn least(&self) -> f64 {
        let reference = self.reference.abs();
        if reference < self.amin { self.amin } else { reference }
    }

    /// Power values to decibels in place. The `top_db` clamp takes its maximum over the whole
    /// slice, as librosa takes it over the whole array, channels included; NaN spreads with it.
    ///
    /// # Errors
    /// `amin <= 0` or `top_db < 0`.
    pub fn power<T: Real>(&self, values: &mut [T]) -> Result<()> {
        self.check()?;
        let parts = values.par_chunks_mut(PART).map(|part| {
            let powers = part.to_vec();
            self.convert(&powers, part)
        });
        let extremes: Vec<_> = parts.collect();
        self.clamp(values, &extremes);
        Ok(())
    }

    /// [`power`](Self::power) of `values` as a new array.
    ///
    /// # Errors
    /// As `power`.
    pub fn of<T: Real>(&self, values: &[T]) -> Result<Vec<T>> {
        let mut out = vec![T::zero(); values.len()];
        self.write(values, &mut out)?;
        Ok(out)
    }

    /// [`power`](Self::power) of `values` written into `out`.
    ///
    /// # Errors
    /// As `power`, or an array of another length.
    pub fn write<T: Real>(&self, values: &[T], out: &mut [T]) -> Result<()> {
        self.check()?;
        if out.len() != values.len() {
            let expected = format!("[{}]", values.len());
            return Err(DspError::Shape { name: "out", expected, actual: vec![out.len()] });
        }
        let parts = out.par_chunks_mut(PART).zip(values.par_chunks(PART));
        let extremes: Vec<_> = parts.map(|(out, values)| self.convert(values, out)).collect();
        self.clamp(out, &extremes);
        Ok(())
    }

    /// Decibels of `values` without the clamp; the smallest and the largest of them, NaN where one is.
    fn convert<T: Real>(&self, values: &[T], out: &mut [T]) -> (T, T) {
        let floor = self.amin as f32;
        if let (Some(values), Some(out)) = (T::as_f32(values), T::as_f32_mut(out))
            && floor.is_normal()
            && part_finite(values)
        {
            let least = self.least() as f32;
            // By the function of the values, so that the reference itself becomes 0.
            let offset = if least.is_normal() { decibel(least) } else { self.offset() as f32 };
            let (low, high) = map(
                values,
                out,
                #[inline(always)]
                |x| decibel(x.max(floor)) - offset,
            );
            return (T::of(low.into()), T::of(high.into()));
        }
        if !T::SINGLE && self.amin.is_normal() && part_finite(values) {
            let (amin, least) = (self.amin, self.least());
            let offset = if least.is_normal() { decibel_double(least) } else { self.offset() };
            return map(
                values,
                out,
                #[inline(always)]
                |x| {
                    let x = x.wide();
                    T::of(decibel_double(if x < amin { amin } else { x }) - offset)
                },
            );
        }
        let (amin, offset, ten) = (T::of(self.amin), T::of(self.offset()), T::of(10.0));
        let none = (T::infinity(), T::neg_infinity());
        out.iter_mut().zip(values).fold(none, |(low, high), (slot, v)| {
            // Written so that NaN stays NaN.
            let floored = if *v < amin { amin } else { *v };
            *slot = ten * floored.log10() - offset;
            (smaller(low, *slot), larger(high, *slot))
        })
    }

    /// Clamps to the range below the largest value; `extremes` are those of the parts.
    fn clamp<T: Real>(&self, values: &mut [T], extremes: &[(T, T)]) {
        let Some(top_db) = self.top_db else { return };
        let peak = extremes.iter().fold(T::neg_infinity(), |peak, (_, high)| larger(peak, *high));
        let floor = peak - T::of(top_db);
        values.par_chunks_mut(PART).zip(extremes).for_each(|(part, (low, _))| {
            // Parts within the range stay as they are.
            if *low >= floor {
                return;
            }
            vectorized(
                #[inline(always)]
                || {
                    for v in part {
                        *v = larger(*v, floor);
                    }
                },
            );
        });
    }
}

/// Values that one thread takes at a time: they stay in its nearest cache.
const PART: usize = 1 << 12;

/// The larger one, NaN where one is.
#[inline(always)]
pub(crate) fn larger<T: Real>(a: T, b: T) -> T {
    if a > b || a.is_nan() { a } else { b }
}

/// The smaller one, NaN where one is.
fn smaller<T: Real>(a: T, b: T) -> T {
    if a < b || a.is_nan() { a } else { b }
}

/// `of` every value, none of which is NaN, into `out`; the smallest and the largest result.
#[inline(always)]
fn map<T: Real>(values: &[T], out: &mut [T], of: impl Fn(T) -> T) -> (T, T) {
    // Two passes: with the extremes in it, the first would not be vectorised.
    vectorized(
        #[inline(always)]
        || out.iter_mut().zip(values).for_each(|(slot, value)| *slot = of(*value)),
    );
    let least = |a: T, b: T| if b < a { b } else { a };
    let most = |a: T, b: T| if b > a { b } else { a };
    let infinity = T::infinity();
    vectorized(
        #[inline(always)]
        || {
            let (mut low, mut high) = ([infinity; LANES], [-infinity; LANES]);
            let (blocks, rest) = out.as_chunks::<LANES>();
            for block in blocks {
                for l in 0..LANES {
                    low[l] = least(low[l], block[l]);
                }
                for l in 0..LANES {
                    high[l] = most(high[l], block[l]);
                }
            }
            let (low, high) = (low.iter().chain(rest), high.iter().chain(rest));
            (low.copied().fold(infinity, least), high.copied().fold(-infinity, most))
        },
    )
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
    fn the_reference_itself_becomes_0_and_a_reference_that_is_nan_leaves_no_number() {
        for reference in [1.0, 0.3, 1234.567, 1e-9_f64] {
            let decibel = Decibel { reference, ..Decibel::default() };
            assert_eq!(decibel.of(&[reference]).unwrap(), [0.0]);
            let single = reference as f32;
            let decibel = Decibel { reference: f64::from(single), ..decibel };
            assert_eq!(decibel.of(&[single]).unwrap(), [0.0]);
        }
        let decibel = Decibel { reference: f64::NAN, ..Decibel::default() };
        assert!(decibel.of(&[1.0_f64, 4.0]).unwrap().iter().all(|v| v.is_nan()));
        assert!(decibel.of(&[1.0_f32, 4.0]).unwrap().iter().all(|v| v.is_nan()));
    }

    #[test]
    fn the_clamp_is_joint() {
        let mut x = vec![1.0_f32, 1e-12, 1e-3];
        Decibel::default().power(&mut x).unwrap();
        assert_eq!(x[1], -80.0);
    }

    #[test]
    fn both_precisions_agree_and_nan_spreads_with_the_clamp() {
        let x: Vec<f64> = (0..40_000).map(|i| f64::from(i * 7919 % 40_000) * 1e-3).collect();
        let single: Vec<f32> = x.iter().map(|x| *x as f32).collect();
        let decibel = Decibel { reference: 3.0, amin: 1e-6, top_db: Some(60.0) };
        let (want, got) = (decibel.of(&x).unwrap(), decibel.of(&single).unwrap());
        assert!(want.iter().zip(&got).all(|(w, g)| (w - f64::from(*g)).abs() < 2e-5));
        let mut in_place = single.clone();
        decibel.power(&mut in_place).unwrap();
        assert_eq!(in_place, got);
        let plain = Decibel { amin: f64::MIN_POSITIVE / 2.0, top_db: None, ..decibel };
        let (mut fast, mut slow) = (x[1..].to_vec(), x[1..].to_vec());
        Decibel { amin: 1e-300, ..plain }.power(&mut fast).unwrap();
        plain.power(&mut slow).unwrap();
        assert!(fast.iter().zip(&slow).all(|(a, b)| (a - b).abs() <= 5e-14));
        let spoilt = [1.0, f32::NAN, 2.0];
        assert!(decibel.of(&spoilt).unwrap().iter().all(|x| x.is_nan()));
        let raw = Decibel { top_db: None, ..decibel }.of(&spoilt).unwrap();
        assert!(raw[0].is_finite() && raw[1].is_nan());
    }

    #[test]
    fn impossible_values_are_refused() {
        let mut x = [1.0_f32];
        assert!(Decibel { amin: 0.0, ..Decibel::default() }.power(&mut x).is_err());
        assert!(Decibel { top_db: Some(-1.0), ..Decibel::default() }.power(&mut x).is_err());
    }
}
