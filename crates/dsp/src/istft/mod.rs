//! Inverse short-time Fourier transform (librosa 0.11 `istft`).

mod overlap_add;

use ndarray::{Array2, ArrayView2, ArrayView3, ArrayViewMut2, Axis};
use num_complex::Complex;

use crate::error::{DspError, Result, room_for};
use crate::lanes::{DoubleRow, Row};
use crate::real::Real;
use crate::stft::{LONGEST_ROWS, StftParams};
use crate::transform::Inverse;
use overlap_add::OverlapAdd;

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
    let mut y = Array2::zeros(istft_shape::<T>(spectrogram.dim(), p, length)?);
    istft_into(spectrogram, p, y.view_mut())?;
    Ok(y)
}

/// Shape `[channels, samples]` of the signal of type `T` that [`istft`] gives for a spectrogram of this one.
///
/// # Errors
/// As [`istft`].
pub fn istft_shape<T: Real>(
    (channels, bins, frames): (usize, usize, usize),
    p: &StftParams,
    length: Option<usize>,
) -> Result<(usize, usize)> {
    p.check()?;
    if bins == 0 || frames == 0 {
        let actual = vec![channels, bins, frames];
        return Err(DspError::Shape { name: "stft_matrix", expected: "frames".into(), actual });
    }
    let whole = (frames - 1).checked_mul(p.hop_length).and_then(|n| n.checked_add(p.n_fft));
    let natural = whole.map(|n| n - 2 * p.pad());
    let samples = length.or(natural).ok_or_else(|| {
        DspError::parameter("hop_length", p.hop_length, "so small that the signal fits in memory")
    })?;
    room_for::<T>("the signal", &[channels, samples])?;
    Ok((channels, samples))
}

/// [`istft`] written into `out [channels, samples]`, which is cut or zero-padded to its length.
///
/// # Errors
/// As [`istft`], or an array of other channels or not in C order.
pub fn istft_into<T: Real>(
    spectrogram: ArrayView3<Complex<T>>,
    p: &StftParams,
    mut out: ArrayViewMut2<T>,
) -> Result<()> {
    istft_shape::<T>(spectrogram.dim(), p, Some(out.ncols()))?;
    let channels = spectrogram.len_of(Axis(0));
    if out.nrows() != channels || !out.is_standard_layout() {
        let expected = format!("{channels} channels in C order");
        return Err(DspError::Shape { name: "out", expected, actual: out.shape().to_vec() });
    }
    if p.n_fft > LONGEST_ROWS {
        let inverse = Inverse::<T>::new(p)?;
        for (spectra, mut y) in spectrogram.axis_iter(Axis(0)).zip(out.rows_mut()) {
            one_by_one(p, &inverse, spectra, y.as_slice_mut().expect("in C order"));
        }
    } else if T::SINGLE {
        OverlapAdd::<Row>::new(p)?.run(spectrogram, out);
    } else {
        OverlapAdd::<DoubleRow>::new(p)?.run(spectrogram, out);
    }
    Ok(())
}

/// One channel, frame by frame.
fn one_by_one<T: Real>(
    p: &StftParams,
    inverse: &Inverse<T>,
    spectra: ArrayView2<Complex<T>>,
    y: &mut [T],
) {
    let mut scratch = inverse.scratch();
    let frames = p.frames_within(y.len(), spectra.ncols());
    for t in 0..frames {
        let mut given = spectra.column(t).into_iter().copied();
        scratch.bins().fill_with(|| given.next().unwrap_or_default());
        inverse.add(t, y, &mut scratch);
    }
    inverse.normalize(frames, y);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stft::stft;
    use crate::window::Window;

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

    /// Frame by frame, whatever blocks and parts are made of them.
    #[test]
    fn sums_of_frames_in_both_precisions_and_orders() {
        for (n_fft, hop, win_length, center, frames, bins) in [
            (64, 16, 64, true, 1, 33),
            (64, 16, 50, true, 400, 33),
            (100, 30, 100, false, 230, 51),
            (101, 7, 101, true, 150, 51),
            (64, 64, 64, true, 200, 33),
            (64, 150, 64, false, 90, 33),
            (128, 1, 128, true, 300, 65),
            (64, 16, 64, true, 70, 20),
            (64, 16, 64, true, 70, 40),
            (1, 1, 1, false, 9, 1),
            (2, 1, 2, false, 40, 2),
        ] {
            let window = Window::Hamming;
            let p = StftParams { win_length, window, center, ..StftParams::new(n_fft, hop) };
            let value = |i: usize| ((i * i * 31 + 7 * i) % 1009) as f64 / 1009.0 - 0.5;
            let double = ndarray::Array3::from_shape_fn((2, bins, frames), |(c, k, t)| {
                let i = (c * bins + k) * frames + t;
                Complex::new(value(i), value(i + 5))
            });
            let single = double.mapv(|z| Complex::new(z.re as f32, z.im as f32));
            let inverse = Inverse::<f64>::new(&p).unwrap();
            for length in [None, Some(1), Some(hop * frames / 2 + 1), Some(hop * frames + 1000)] {
                let got = istft(double.view(), &p, length).unwrap();
                let rounded = istft(single.view(), &p, length).unwrap();
                let turned = double.t().as_standard_layout().into_owned();
                assert_eq!(istft(turned.t(), &p, length).unwrap(), got);
                for c in 0..2 {
                    let mut want = vec![0.0; got.ncols()];
                    one_by_one(&p, &inverse, double.index_axis(Axis(0), c), &mut want);
                    let largest = want.iter().fold(1e-3, |m: f64, x| m.max(x.abs()));
                    for (i, want) in want.iter().enumerate() {
                        let name = format!("{n_fft} {hop} {length:?} sample {i} for {want}");
                        let (got, rounded) = (got[[c, i]], f64::from(rounded[[c, i]]));
                        assert!((got - want).abs() < 1e-12 * largest, "{name}: {got}");
                        assert!((rounded - want).abs() < 1e-5 * largest, "{name}: {rounded}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_missing_spectrogram_is_refused() {
        let empty = ndarray::Array3::<Complex<f32>>::zeros((1, 257, 0));
        assert!(istft(empty.view(), &StftParams::new(512, 128), None).is_err());
        let spectrogram = ndarray::Array3::<Complex<f32>>::zeros((2, 257, 3));
        let mut other = Array2::zeros((1, 100));
        let p = StftParams::new(512, 128);
        assert!(istft_into(spectrogram.view(), &p, other.view_mut()).is_err());
    }
}
