//! Inverse short-time Fourier transform (librosa 0.11 `istft`).

use ndarray::{Array2, ArrayView3, Axis};
use num_complex::Complex;

use crate::error::{DspError, Result};
use crate::real::Real;
use crate::stft::StftParams;
use crate::transform::Inverse;

/// Signal `[channels, samples]` whose transform with `p` is nearest to `spectrogram`
/// `[channels, n_fft / 2 + 1, frames]` in the least-squares sense: overlap-add of the windowed
/// inverse transforms, divided by the sum of the squared windows.
///
/// With `length` the signal is cut or zero-padded to that many samples and only the frames that
/// reach it count; without, a partial last hop is missing. Spectra with fewer or more bins than
/// `n_fft / 2 + 1` are padded or cut, as `numpy.fft.irfft` does. `pad_mode` plays no part.
///
/// # Errors
/// Impossible parameters, or no frames.
pub fn istft<T: Real>(
    spectrogram: ArrayView3<Complex<T>>,
    p: &StftParams,
    length: Option<usize>,
) -> Result<Array2<T>> {
    let inverse = Inverse::<T>::new(p)?;
    let (channels, bins, available) = spectrogram.dim();
    if bins == 0 || available == 0 {
        let actual = spectrogram.shape().to_vec();
        return Err(DspError::Shape { name: "stft_matrix", expected: "frames".into(), actual });
    }
    let frames = length.map_or(available, |n| inverse.frames_within(n, available));
    let whole = (frames - 1)
        .checked_mul(p.hop_length)
        .and_then(|n| n.checked_add(p.n_fft))
        .ok_or_else(|| {
            DspError::parameter(
                "hop_length",
                p.hop_length,
                "so small that the signal fits in memory",
            )
        })?;
    let n = length.unwrap_or(whole - 2 * p.pad());
    let mut y = Array2::zeros((channels, n));
    let mut scratch = inverse.scratch();
    for (spectra, mut y) in spectrogram.axis_iter(Axis(0)).zip(y.rows_mut()) {
        let y = y.as_slice_mut().expect("a new array");
        for t in 0..frames {
            let mut given = spectra.column(t).into_iter().copied();
            scratch.bins().fill_with(|| given.next().unwrap_or_default());
            inverse.add(t, y, &mut scratch);
        }
        inverse.normalize(frames, y);
    }
    Ok(y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stft::stft;

    #[test]
    fn inverts_the_transform() {
        let y = Array2::from_shape_fn((2, 3001), |(c, i)| ((c + 1) * i % 97) as f64 / 97.0);
        for (n_fft, hop) in [(512, 128), (401, 100), (1024, 300)] {
            let p = StftParams::new(n_fft, hop);
            let spectrogram = stft(y.view(), &p).unwrap();
            let back = istft(spectrogram.view(), &p, Some(3001)).unwrap();
            let reached = 3001 - hop;
            let error = (&back - &y).slice(ndarray::s![.., ..reached]).mapv(f64::abs);
            assert!(error.iter().all(|e| *e < 1e-12), "n_fft {n_fft}, hop {hop}");
            let natural = istft(spectrogram.view(), &p, None).unwrap();
            assert_eq!(natural.ncols(), (3001 / hop) * hop + n_fft % 2);
        }
    }

    #[test]
    fn a_missing_spectrogram_is_refused() {
        let empty = ndarray::Array3::<Complex<f32>>::zeros((1, 257, 0));
        assert!(istft(empty.view(), &StftParams::new(512, 128), None).is_err());
    }
}
