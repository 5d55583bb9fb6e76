//! Spectrograms of whole arrays.

use ndarray::{Array3, ArrayView2, ArrayViewMut3, Axis};
use num_complex::Complex;

use super::params::StftParams;
use crate::error::{DspError, Result};
use crate::lanes::{DoubleRow, Lanes, Row};
use crate::real::Real;
use crate::simd::vectorized;
use crate::tiles::{LanePlan, for_each_tile, neighbours, planar};
use crate::transform::Forward;

/// Longest transform of rows, which take 192 bytes a sample and thread; of longer ones frames are
/// taken one by one.
pub(crate) const LONGEST_ROWS: usize = 1 << 16;

/// Complex spectrogram `[channels, n_fft / 2 + 1, frames]` of `y [channels, samples]` (librosa 0.11
/// `stft`). `f32` signals are transformed in single precision (within 1e-6 of the largest value of
/// a frame), `f64` signals in double precision.
///
/// # Errors
/// Impossible parameters, or a signal too short for one frame.
///
/// ```
/// use corsmal_dsp::stft::{StftParams, stft};
///
/// let y = ndarray::Array2::<f64>::ones((1, 4096));
/// let spectrum = stft(y.view(), &StftParams::new(1024, 256))?;
/// assert_eq!(spectrum.dim(), (1, 513, 17));
/// assert!((spectrum[[0, 0, 8]].re - 512.0).abs() < 1e-9); // the sum of the window
/// # Ok::<(), corsmal_dsp::DspError>(())
/// ```
pub fn stft<T: Real>(y: ArrayView2<T>, p: &StftParams) -> Result<Array3<Complex<T>>> {
    let mut out = Array3::zeros(p.shape_of(y)?);
    stft_into(y, p, out.view_mut())?;
    Ok(out)
}

/// [`stft`] written into `out`, whose shape is [`StftParams::shape_of`].
///
/// # Errors
/// As [`stft`], or another shape.
pub fn stft_into<T: Real>(
    y: ArrayView2<T>,
    p: &StftParams,
    out: ArrayViewMut3<Complex<T>>,
) -> Result<()> {
    check_out(&out, p.shape_of(y)?)?;
    let y = planar(y);
    if T::SINGLE {
        let value = |re: f32, im: f32| Complex::new(T::of(re.into()), T::of(im.into()));
        each_bin::<T, Row, _>(y.view(), p, out, value)
    } else {
        each_spectrum::<T, T, _>(y.view(), p, out, |z| z)
    }
}

fn check_out<R>(out: &ArrayViewMut3<R>, shape: (usize, usize, usize)) -> Result<()> {
    if out.dim() == shape && out.is_standard_layout() {
        return Ok(());
    }
    let expected = format!("{shape:?} in C order");
    Err(DspError::Shape { name: "out", expected, actual: out.shape().to_vec() })
}

/// `|stft|^power` as `[channels, n_fft / 2 + 1, frames]` (librosa 0.11 `_spectrogram`), by a
/// transform in double precision whatever `T` is, as features need that amplify its rounding.
///
/// # Errors
/// As [`stft`].
pub fn spectrogram<T: Real>(y: ArrayView2<T>, p: &StftParams, power: f64) -> Result<Array3<T>> {
    spectrogram_as(y, p, power)
}

/// [`spectrogram`] with values of the type `V`.
///
/// # Errors
/// As [`stft`].
pub(crate) fn spectrogram_as<T: Real, V: Real>(
    y: ArrayView2<T>,
    p: &StftParams,
    power: f64,
) -> Result<Array3<V>> {
    let mut out = Array3::zeros(p.shape_of(y)?);
    fill(y, p, power, out.view_mut())?;
    Ok(out)
}

/// [`spectrogram`] written into `out`, whose shape is [`StftParams::shape_of`].
///
/// # Errors
/// As [`stft`], or another shape.
pub fn spectrogram_into<T: Real>(
    y: ArrayView2<T>,
    p: &StftParams,
    power: f64,
    out: ArrayViewMut3<T>,
) -> Result<()> {
    check_out(&out, p.shape_of(y)?)?;
    fill(y, p, power, out)
}

/// [`spectrogram_into`] of an array of the right shape and any type.
fn fill<T: Real, V: Real>(
    y: ArrayView2<T>,
    p: &StftParams,
    power: f64,
    out: ArrayViewMut3<V>,
) -> Result<()> {
    let y = planar(y);
    match power {
        1.0 => each_spectrum(y.view(), p, out, magnitude::<V>),
        2.0 => each_spectrum(y.view(), p, out, |z: Complex<V>| magnitude(z) * magnitude(z)),
        _ => each_spectrum(y.view(), p, out, |z: Complex<V>| magnitude(z).powf(V::of(power))),
    }
}

/// Magnitude of a bin as librosa has it: of the value rounded to `T`.
#[inline(always)]
pub(crate) fn magnitude<T: Real>(z: Complex<T>) -> T {
    if T::SINGLE {
        let (re, im) = (z.re.wide(), z.im.wide());
        return T::of((re * re + im * im).sqrt());
    }
    let square = z.re * z.re + z.im * z.im;
    // What is left of it may have lost digits, or all.
    if square.is_normal() { square.sqrt() } else { z.norm() }
}

/// Fills `out` with `value` of every bin, transformed in double precision and rounded to `Z`.
fn each_spectrum<T: Real, Z: Real, V: Copy + Send>(
    y: ArrayView2<T>,
    p: &StftParams,
    out: ArrayViewMut3<V>,
    value: impl Fn(Complex<Z>) -> V + Sync,
) -> Result<()> {
    each_bin::<T, DoubleRow, V>(y, p, out, |re, im| value(Complex::new(Z::of(re), Z::of(im))))
}

/// Fills `out` with `value` of the real and imaginary part of every bin, transformed in the
/// precision of the rows `R`.
fn each_bin<T: Real, R: Lanes, V: Copy + Send>(
    y: ArrayView2<T>,
    p: &StftParams,
    out: ArrayViewMut3<V>,
    value: impl Fn(R::Value, R::Value) -> V + Sync,
) -> Result<()> {
    if p.n_fft > LONGEST_ROWS {
        return one_by_one::<T, R::Value, V>(y, p, out, value);
    }
    let plan = LanePlan::<R>::new(p)?;
    let state = || (plan.frames(), vec![R::EMPTY; 2 * p.n_bins()]);
    for_each_tile(out, state, |(frames, spectrum), mut tile| {
        let y = y.row(tile.channel);
        let y = y.to_slice().expect("contiguous");
        for (b, mut block) in tile.out.axis_chunks_iter_mut(Axis(1), R::SLOTS).enumerate() {
            frames.complex(y, tile.first + b * R::SLOTS, spectrum);
            let rows = block.outer_iter_mut().zip(spectrum.as_chunks().0);
            for (row, [re, im]) in rows {
                let row = neighbours(row);
                vectorized(
                    #[inline(always)]
                    || {
                        let parts = re.values().iter().zip(im.values());
                        for (slot, (re, im)) in row.iter_mut().zip(parts) {
                            *slot = value(*re, *im);
                        }
                    },
                );
            }
        }
    });
    Ok(())
}

/// [`each_bin`] frame by frame.
fn one_by_one<T: Real, F: Real, V: Copy + Send>(
    y: ArrayView2<T>,
    p: &StftParams,
    out: ArrayViewMut3<V>,
    value: impl Fn(F, F) -> V + Sync,
) -> Result<()> {
    let plan = Forward::<F>::new(p)?;
    for_each_tile(
        out,
        || plan.scratch(),
        |scratch, mut tile| {
            let y = y.row(tile.channel);
            let y = y.to_slice().expect("contiguous");
            for (t, mut frame) in tile.out.columns_mut().into_iter().enumerate() {
                let bins = plan.spectrum(y, tile.first + t, scratch);
                frame.iter_mut().zip(bins).for_each(|(slot, z)| *slot = value(z.re, z.im));
            }
        },
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn constant_signal_has_the_window_sum_at_dc() {
        let y = Array2::<f64>::ones((1, 4096));
        let d = stft(y.view(), &StftParams::new(1024, 256)).unwrap();
        assert!((d[[0, 0, 8]].re - 512.0).abs() < 1e-9);
    }

    /// Transforms on either side of the longest of rows agree where they have bins in common.
    #[test]
    fn long_transforms_are_taken_one_by_one() {
        let y =
            Array2::from_shape_fn((2, 40_000), |(c, i)| ((i * i) % 211) as f64 - 105.0 * c as f64);
        let flat = |n_fft| StftParams { win_length: 1000, ..StftParams::new(n_fft, 9000) };
        let rows = spectrogram(y.view(), &flat(LONGEST_ROWS), 1.0).unwrap();
        let single = spectrogram(y.view(), &flat(2 * LONGEST_ROWS), 1.0).unwrap();
        assert_eq!(rows.dim().2, single.dim().2);
        for ((c, k, t), x) in rows.indexed_iter() {
            assert!((x - single[[c, 2 * k, t]]).abs() < 1e-6 * (1.0 + x), "{c} {k} {t}");
        }
    }

    #[test]
    fn results_of_another_shape_or_order_are_refused() {
        let (y, p) = (Array2::<f32>::zeros((2, 1000)), StftParams::new(256, 64));
        let (channels, bins, frames) = p.shape_of(y.view()).unwrap();
        let mut short = Array3::zeros((channels, bins, frames - 1));
        assert!(stft_into(y.view(), &p, short.view_mut()).is_err());
        let mut turned = Array3::zeros((frames, bins, channels));
        let turned = turned.view_mut().reversed_axes();
        assert!(spectrogram_into(y.view(), &p, 1.0, turned).is_err());
    }
}
