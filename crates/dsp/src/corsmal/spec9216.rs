//! The spectrogram input of the classical baselines.

use ndarray::{Array1, Array2, ArrayView1, s};

use super::padded_amplitude_db;
use crate::error::{DspError, Result};
use crate::real::{Real, require_finite};
use crate::resize::{ResizeParams, resize};
use crate::stft::{PadMode, StftParams};

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
        require_finite("y", y)?;
        let power = y.iter().map(|v| v.wide() * v.wide()).sum::<f64>() / y.len() as f64;
        let rms = T::of(power.sqrt());
        if rms.is_nan() || rms <= T::zero() {
            let actual = y.len();
            return Err(if actual == 0 {
                DspError::TooShort { name: "y", actual, needed: 1 }
            } else {
                DspError::parameter("y", "silence", "a signal with an RMS above 0")
            });
        }
        let scaled = y.mapv(|v| v / rms);
        match self.fixed_len {
            Some(len) if len > y.len() => self.image(scaled.mapv(Real::wide), len),
            Some(len) => self.image(scaled.slice_move(s![..len]), len),
            None => self.image(scaled, y.len()),
        }
    }

    /// The image of `y` and zeros up to `len` samples.
    fn image<T: Real>(&self, y: Array1<T>, len: usize) -> Result<Array2<f64>> {
        let params = StftParams { pad_mode: self.pad_mode, ..StftParams::new(512, 128) };
        let decibels = padded_amplitude_db(y.view(), len, &params)?;
        Ok(resize(decibels.view(), &ResizeParams::new(96, 96))?.mapv(Real::wide))
    }
}
