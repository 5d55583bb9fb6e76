//! Decibels (librosa 0.11 `power_to_db`, `amplitude_to_db`).

use rayon::prelude::*;

use crate::error::{DspError, Result};
use crate::lanes::{LANES, Row, decibel_double, power_to_decibel};
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
        10.0 * self.amin.max(self.reference.abs()).log10()
    }

    /// Power values to decibels in place. The `top_db` clamp takes its maximum over the whole
    /// slice, as librosa takes it over the whole array, channels included; NaN spreads with it.
    ///
    /// # Errors
    /// `amin <= 0` or `top_db < 0`.
    pub fn power<T: Real>(&self, values: &mut [T]) -> Result<()> {
        self.check()?;
        let peaks = values.par_chunks_mut(PART).map(|part| self.convert(part));
        let peak = peaks.reduce(T::neg_infinity, larger);
        self.clamp(values, peak);
        Ok(())
    }

    /// [`power`](Self::power) of `values` as a new array.
    ///
    /// # Errors
    /// As `power`.
    pub fn of<T: Real>(&self, values: &[T]) -> Result<Vec<T>> {
        self.check()?;
        let mut out = vec![T::zero(); values.len()];
        let parts = out.par_chunks_mut(PART).zip(values.par_chunks(PART));
        let peaks = parts.map(|(part, values)| {
            part.copy_from_slice(values);
            self.convert(part)
        });
        let peak = peaks.reduce(T::neg_infinity, larger);
        self.clamp(&mut out, peak);
        Ok(out)
    }

    /// Decibels in place without the clamp; the largest of them.
    fn convert<T: Real>(&self, values: &mut [T]) -> T {
        let floor = self.amin as f32;
        if let Some(values) = T::as_f32_mut(values)
            && floor.is_normal()
            && part_finite(values)
        {
            return T::of(f64::from(convert_rows(values, floor, self.offset() as f32)));
        }
        if !T::SINGLE && self.amin.is_normal() && part_finite(values) {
            return convert_doubles(values, self.amin, self.offset());
        }
        let (amin, offset, ten) = (T::of(self.amin), T::of(self.offset()), T::of(10.0));
        values.iter_mut().fold(T::neg_infinity(), |peak, v| {
            // Written so that NaN stays NaN.
            let floored = if *v < amin { amin } else { *v };
            *v = ten * floored.log10() - offset;
            larger(peak, *v)
        })
    }

    fn clamp<T: Real>(&self, values: &mut [T], peak: T) {
        let Some(top_db) = self.top_db else { return };
        let floor = peak - T::of(top_db);
        values.par_chunks_mut(PART).for_each(|part| {
            vectorized(
                #[inline(always)]
                || part.iter_mut().for_each(|v| *v = larger(*v, floor)),
            );
        });
    }
}

/// Values that one thread takes at a time: they stay in its nearest cache.
const PART: usize = 1 << 12;

/// The larger one, NaN where one is.
fn larger<T: Real>(a: T, b: T) -> T {
    if a > b || a.is_nan() { a } else { b }
}

/// Decibels in place by rows; the largest of them.
fn convert_rows(values: &mut [f32], amin: f32, offset: f32) -> f32 {
    const ROWS: usize = 16;
    let mut rows = [Row::ZERO; ROWS];
    let mut peak = [f32::NEG_INFINITY; LANES];
    for part in values.chunks_mut(ROWS * LANES) {
        if part.len() < ROWS * LANES {
            // What is left of the row becomes the floor, which is not a peak.
            rows = [Row::ZERO; ROWS];
        }
        for (row, values) in rows.iter_mut().zip(part.chunks(LANES)) {
            row.0[..values.len()].copy_from_slice(values);
        }
        power_to_decibel(&mut rows, amin, offset);
        for (row, values) in rows.iter().zip(part.chunks_mut(LANES)) {
            values.copy_from_slice(&row.0[..values.len()]);
        }
        vectorized(
            #[inline(always)]
            || {
                for row in &rows {
                    for (peak, x) in peak.iter_mut().zip(&row.0) {
                        *peak = if *x > *peak { *x } else { *peak };
                    }
                }
            },
        );
    }
    peak.into_iter().fold(f32::NEG_INFINITY, f32::max)
}

/// Decibels in place of finite values in double precision; the largest of them.
fn convert_doubles<T: Real>(values: &mut [T], amin: f64, offset: f64) -> T {
    let mut peak = [f64::NEG_INFINITY; LANES];
    vectorized(
        #[inline(always)]
        || {
            for values in values.chunks_mut(LANES) {
                for (peak, v) in peak.iter_mut().zip(values) {
                    let x = v.wide();
                    let x = decibel_double(if x < amin { amin } else { x }) - offset;
                    *v = T::of(x);
                    *peak = if x > *peak { x } else { *peak };
                }
            }
        },
    );
    T::of(peak.into_iter().fold(f64::NEG_INFINITY, f64::max))
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
