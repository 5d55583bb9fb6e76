//! The spectrogram input of the classical baselines.

use ndarray::{Array2, ArrayView1};

use super::image::decibel_image;
use crate::error::{DspError, Result};
use crate::real::{Real, require_all_finite};
use crate::simd::vectorized;
use crate::stft::{PadMode, StftParams};
use crate::sums::sum;

/// 96 x 96 decibels (9216 values) of one channel divided by its RMS: 512-point transform, hop 128,
/// 80 dB deep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Spec9216 {
    /// Cut or fill with zeros to this many samples (10 s in the baselines), after normalising.
    pub fixed_len: Option<usize>,
    /// Padding of centred frames: `Reflect` for the baselines' librosa 0.8.
    pub pad_mode: PadMode,
}

impl Spec9216 {
    /// `[96, 96]` (frequency, time) of mono `y`. The baselines' zero padding makes the rest run in
    /// double precision whatever `T` is; otherwise the values are those of `T`.
    ///
    /// # Errors
    /// Silence (it has no RMS to divide by), no or non-finite samples.
    pub fn run<T: Real>(&self, y: ArrayView1<T>) -> Result<Array2<f64>> {
        require_all_finite("y", y)?;
        let y = y.to_vec();
        let squares = vectorized(
            #[inline(always)]
            || sum(&y, |v| v.wide() * v.wide()),
        );
        let rms = T::of((squares / y.len() as f64).sqrt());
        if rms.is_nan() || rms <= T::zero() {
            let actual = y.len();
            return Err(if actual == 0 {
                DspError::TooShort { name: "y", actual, needed: 1 }
            } else {
                DspError::parameter("y", "silence", "a signal with an RMS above 0")
            });
        }
        let mut scaled = y;
        let len = self.fixed_len.unwrap_or(scaled.len());
        let padded = len > scaled.len();
        scaled.truncate(len);
        scaled.iter_mut().for_each(|v| *v /= rms);
        let params = StftParams { pad_mode: self.pad_mode, ..StftParams::new(512, 128) };
        if padded {
            return decibel_image::<T, f64>(scaled, len, &params);
        }
        Ok(decibel_image::<T, T>(scaled, len, &params)?.mapv(Real::wide))
    }
}
