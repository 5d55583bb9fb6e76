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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resize::resize;
    use crate::stft::{PadMode, spectrogram};
    use ndarray::Axis;

    #[test]
    fn an_image_of_padding_is_that_of_the_padded_signal() {
        for pad_mode in [PadMode::Constant, PadMode::Edge, PadMode::Reflect, PadMode::Symmetric] {
            let params = StftParams { pad_mode, ..StftParams::new(512, 128) };
            for n in [1, 511, 3000, 39_999, 40_000] {
                let y: Vec<f32> = (0..n).map(|i| ((i * i) % 211) as f32 / 211.0 - 0.4).collect();
                let mut padded = y.clone();
                padded.resize(40_000, 0.0);
                let padded = ArrayView2::from_shape((1, 40_000), &padded).unwrap();
                let mut power = spectrogram(padded, &params, 2.0).unwrap();
                Decibel::default().power(power.as_slice_mut().unwrap()).unwrap();
                let image = power.index_axis(Axis(0), 0);
                let want = resize(image, &ResizeParams::new(SIDE, SIDE)).unwrap();
                let found = decibel_image::<f32, f32>(y, 40_000, &params).unwrap();
                assert_eq!(found, want, "{n} {pad_mode:?}");
            }
        }
    }
}
