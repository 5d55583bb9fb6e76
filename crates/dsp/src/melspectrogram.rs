//! Mel spectrograms of whole signals (librosa 0.11 `feature.melspectrogram`).

use ndarray::{Array3, ArrayView2, ArrayViewMut3, Axis};
use num_complex::Complex;

use crate::error::{DspError, Result};
use crate::lanes::{DoubleRow, Lanes, Row, weighted_sums};
use crate::mel::SparseBank;
use crate::real::Real;
use crate::stft::{LONGEST_ROWS, StftParams, magnitude};
use crate::sums;
use crate::tiles::{LanePlan, for_each_tile, neighbours, planar};
use crate::transform::Forward;

/// `bank @ |stft(y)|^power` as `[channels, bands, frames]` of `y [channels, samples]`: the
/// spectrogram itself is never held. Precision as in [`stft`](crate::stft::stft).
///
/// # Errors
/// As [`stft`](crate::stft::stft), or a bank for another transform length.
pub fn melspectrogram<T: Real>(
    y: ArrayView2<T>,
    stft: &StftParams,
    power: f64,
    bank: &SparseBank,
) -> Result<Array3<T>> {
    if bank.bins() != stft.n_bins() {
        let expected = format!("{} bins for n_fft = {}", stft.n_bins(), stft.n_fft);
        let actual = vec![bank.bands().len(), bank.bins()];
        return Err(DspError::Shape { name: "bank", expected, actual });
    }
    let bands = bank.bands().len();
    let (channels, _, frames) = stft.shape_of(y)?;
    let mut out = Array3::zeros((channels, bands, frames));
    let y = planar(y);
    if stft.n_fft > LONGEST_ROWS {
        one_by_one(y.view(), stft, power, bank, out.view_mut())?;
    } else if T::SINGLE {
        rows_of::<T, Row>(y.view(), stft, power, bank.bands(), out.view_mut())?;
    } else {
        let wide = |weights: &Vec<f32>| weights.iter().map(|w| f64::from(*w)).collect();
        let bands: Vec<_> = bank.bands().iter().map(|(k, w)| (*k, wide(w))).collect();
        rows_of::<T, DoubleRow>(y.view(), stft, power, &bands, out.view_mut())?;
    }
    Ok(out)
}

/// [`melspectrogram`] of contiguous channels in the precision of the rows `R`.
fn rows_of<T: Real, R: Lanes>(
    y: ArrayView2<T>,
    stft: &StftParams,
    power: f64,
    bands: &[(usize, Vec<R::Value>)],
    out: ArrayViewMut3<T>,
) -> Result<()> {
    let plan = LanePlan::<R>::new(stft)?;
    let rows = |n| vec![R::EMPTY; n];
    let state = || (plan.frames(), rows(stft.n_bins()), rows(bands.len()));
    for_each_tile(out, state, |(frames, spectrum, mel), mut tile| {
        let y = y.row(tile.channel);
        let y = y.to_slice().expect("contiguous");
        for (b, mut block) in tile.out.axis_chunks_iter_mut(Axis(1), R::SLOTS).enumerate() {
            frames.power(y, tile.first + b * R::SLOTS, power, spectrum);
            weighted_sums(bands, spectrum, mel);
            for (row, mel) in block.outer_iter_mut().zip(&*mel) {
                let row = neighbours(row).iter_mut();
                row.zip(mel.values()).for_each(|(slot, x)| *slot = T::of(x.wide()));
            }
        }
    });
    Ok(())
}

/// [`rows_of`] frame by frame, in double precision.
fn one_by_one<T: Real>(
    y: ArrayView2<T>,
    stft: &StftParams,
    power: f64,
    bank: &SparseBank,
    out: ArrayViewMut3<T>,
) -> Result<()> {
    let forward = Forward::<f64>::new(stft)?;
    let state = || (forward.scratch(), vec![T::zero(); stft.n_bins()]);
    for_each_tile(out, state, |(scratch, spectrum), mut tile| {
        let y = y.row(tile.channel);
        let y = y.to_slice().expect("contiguous");
        for (t, mut column) in tile.out.columns_mut().into_iter().enumerate() {
            let bins = forward.spectrum(y, tile.first + t, scratch);
            for (slot, z) in spectrum.iter_mut().zip(bins) {
                *slot = raised(Complex::new(T::of(z.re), T::of(z.im)), power);
            }
            for (slot, (first, weights)) in column.iter_mut().zip(bank.bands()) {
                let weighted = |w: f32, x: T| T::of(f64::from(w)) * x;
                *slot = sums::sum_pairs(weights, &spectrum[*first..], weighted);
            }
        }
    });
    Ok(())
}

/// `|z|^power`.
#[inline(always)]
fn raised<T: Real>(z: Complex<T>, power: f64) -> T {
    if power == 2.0 {
        z.norm_sqr()
    } else if power == 1.0 {
        magnitude(z)
    } else {
        magnitude(z).powf(T::of(power))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mel::{MelParams, mel_filter};
    use crate::stft::{PadMode, spectrogram};
    use ndarray::Array2;

    fn noise(n: usize) -> Array2<f64> {
        let mut state = 7_u32;
        Array2::from_shape_simple_fn((2, n), || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        })
    }

    #[test]
    fn both_precisions_are_the_bank_times_the_spectrogram() {
        for (n, n_fft, hop, center) in [
            (1, 64, 16, true),
            (9000, 512, 128, true),
            (5000, 300, 77, false),
            (40, 64, 100, true),
            (9000, 64, 200, true),
            (9, 64, usize::MAX / 2, true),
        ] {
            for power in [1.0, 2.0, 1.5] {
                let y = noise(n);
                let pad_mode = PadMode::Reflect;
                let stft = StftParams { center, pad_mode, ..StftParams::new(n_fft, hop) };
                let mel = MelParams { n_mels: 12, ..MelParams::new(16000.0, n_fft) };
                let bank = SparseBank::new(&mel_filter(&mel).unwrap());
                let want = bank.apply(spectrogram(y.view(), &stft, power).unwrap().view());
                let double = melspectrogram(y.view(), &stft, power, &bank).unwrap();
                let single = y.mapv(|x| x as f32);
                let single = melspectrogram(single.view(), &stft, power, &bank).unwrap();
                let largest = want.iter().fold(0.0, |m: f64, x| m.max(*x));
                for ((want, double), single) in want.iter().zip(&double).zip(&single) {
                    assert!((want - double).abs() < 1e-12 * largest);
                    assert!((want - f64::from(*single)).abs() < 1e-6 * largest);
                }
            }
        }
    }

    /// Rows of a long transform would take gigabytes a thread.
    #[test]
    fn long_transforms_are_taken_one_by_one() {
        let y = noise(3000);
        let stft = StftParams::new(2 * LONGEST_ROWS, 1000);
        let mel = MelParams { n_mels: 12, ..MelParams::new(16000.0, stft.n_fft) };
        let bank = SparseBank::new(&mel_filter(&mel).unwrap());
        let double = melspectrogram(y.view(), &stft, 2.0, &bank).unwrap();
        let single = melspectrogram(y.mapv(|x| x as f32).view(), &stft, 2.0, &bank).unwrap();
        let largest = double.iter().fold(0.0, |m: f64, x| m.max(*x));
        for (double, single) in double.iter().zip(&single) {
            assert!((double - f64::from(*single)).abs() < 1e-6 * largest);
        }
    }

    #[test]
    fn a_bank_for_another_length_is_refused() {
        let bank = SparseBank::new(&mel_filter(&MelParams::new(16000.0, 256)).unwrap());
        let y = noise(1000);
        assert!(melspectrogram(y.view(), &StftParams::new(512, 128), 2.0, &bank).is_err());
    }
}
