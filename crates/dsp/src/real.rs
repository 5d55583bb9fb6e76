//! The two sample types, `f32` and `f64`.

use std::sync::Arc;

use ndarray::{ArrayView, Dimension};
use num_traits::{Float, FromPrimitive, NumAssign};
use rayon::prelude::*;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::FftNum;

use crate::error::{DspError, Result};
use crate::simd::vectorized;

/// A real sample type: `f32` or `f64`.
///
/// librosa keeps the precision of its input from end to end; functions of this crate are generic
/// over `Real` for the same reason.
pub trait Real: Float + FromPrimitive + NumAssign + FftNum + std::iter::Sum + Default {
    /// Whether this is the single-precision type.
    const SINGLE: bool;
    /// Nearest value of this type.
    fn of(x: f64) -> Self;
    /// Exact widening.
    fn wide(self) -> f64;
    /// The slice as `f32` samples, where this is the `f32` type.
    fn as_f32(slice: &[Self]) -> Option<&[f32]>;
    /// As [`as_f32`](Self::as_f32), to write.
    fn as_f32_mut(slice: &mut [Self]) -> Option<&mut [f32]>;
    /// Plan of a real transform of `n` points. Here, so that only this crate compiles transforms.
    fn forward_transform(n: usize) -> Arc<dyn RealToComplex<Self>>;
    /// Plan of its inverse, which is not normalised.
    fn inverse_transform(n: usize) -> Arc<dyn ComplexToReal<Self>>;
}

impl Real for f32 {
    const SINGLE: bool = true;
    #[inline(always)]
    fn of(x: f64) -> Self {
        x as f32
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
    fn as_f32(slice: &[Self]) -> Option<&[f32]> {
        Some(slice)
    }
    fn as_f32_mut(slice: &mut [Self]) -> Option<&mut [f32]> {
        Some(slice)
    }
    fn forward_transform(n: usize) -> Arc<dyn RealToComplex<Self>> {
        RealFftPlanner::new().plan_fft_forward(n)
    }
    fn inverse_transform(n: usize) -> Arc<dyn ComplexToReal<Self>> {
        RealFftPlanner::new().plan_fft_inverse(n)
    }
}

impl Real for f64 {
    const SINGLE: bool = false;
    #[inline(always)]
    fn of(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
    fn as_f32(_: &[Self]) -> Option<&[f32]> {
        None
    }
    fn as_f32_mut(_: &mut [Self]) -> Option<&mut [f32]> {
        None
    }
    fn forward_transform(n: usize) -> Arc<dyn RealToComplex<Self>> {
        RealFftPlanner::new().plan_fft_forward(n)
    }
    fn inverse_transform(n: usize) -> Arc<dyn ComplexToReal<Self>> {
        RealFftPlanner::new().plan_fft_inverse(n)
    }
}

/// Whether all `values` are finite, on all threads of the pool.
pub fn all_finite<T: Real>(values: &[T]) -> bool {
    values.par_chunks(1 << 16).all(part_finite)
}

/// [`all_finite`] on this thread.
pub(crate) fn part_finite<T: Real>(values: &[T]) -> bool {
    vectorized(
        #[inline(always)]
        || values.iter().fold(true, |finite, x| finite & x.is_finite()),
    )
}

/// [`require_finite`] of an array, at the speed of memory where it is contiguous.
pub(crate) fn require_all_finite<T: Real, D: Dimension>(
    name: &'static str,
    values: ArrayView<T, D>,
) -> Result<()> {
    match values.as_slice() {
        Some(values) if part_finite(values) => Ok(()),
        _ => require_finite(name, &values),
    }
}

/// Refuses NaN and infinities, as librosa's `util.valid_audio` does.
pub fn require_finite<'a, T: Real>(
    name: &'static str,
    values: impl IntoIterator<Item = &'a T>,
) -> Result<()> {
    match values.into_iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(index) => Err(DspError::NonFinite { name, index }),
    }
}
