//! Decibel spectrograms as small images.

use ndarray::{Array2, ArrayView2};

use crate::decibel::Decibel;
use crate::error::Result;
use crate::real::Real;
use crate::resize::{ResizeParams, resize_extended};
use crate::stft::{StftParams, spectrogram_as};

/// Rows and columns of the images that systems take.
const SIDE: usize = 96;

/// `amplitude_to_db(|stft|)` of `y` and zeros up to `len` samples, 80 dB deep, as an image of 96 x 96
/// (frequency, time); values of the type `V`.
///
/// Frames of nothing but zeros are all alike: one is transformed, and stands for those that follow.
pub(super) fn decibel_image<T: Real, V: Real>(
    mut y: Vec<T>,
    len: usize,
    params: &StftParams,
) -> Result<Array2<V>> {
    // So many zeros make the last frame such a one, whatever lies beyond them.
    y.resize(len.min(y.len() + 2 * params.n_fft), T::zero());
    let y = ArrayView2::from_shape((1, y.len()), &y).expect("one row");
    let mut power = spectrogram_as::<T, V>(y, params, 2.0)?;
    Decibel::default().power(power.as_slice_mut().expect("made in C order"))?;
    let (_, bins, known) = power.dim();
    let image = power.into_shape_with_order((bins, known)).expect("one channel");
    resize_extended(image.view(), params.n_frames(len), &ResizeParams::new(SIDE, SIDE))
}
