//! Features of the shape of a spectrum (librosa 0.11 `feature.spectral_*`, `poly_features`).
//!
//! Each file holds a kernel for one spectrum, which allocates nothing, and the function over a
//! whole spectrogram `[channels, bins, frames]`. All of them expect magnitudes; librosa computes
//! those with a transform in double precision, and on mostly empty spectra (silence, clicks, pure
//! tones) bandwidth and contrast depend on that.

mod bandwidth;
mod centroid;
mod contrast;
mod extremes;
mod flatness;
mod poly;
mod rolloff;

use ndarray::{Array3, ArrayView2, ArrayView3, Axis, CowArray, Ix2, s};
use num_complex::Complex;

use crate::error::{DspError, Result};
use crate::lanes::{DoubleRow, LANES, Lanes};
use crate::real::{Real, require_finite};
use crate::simd::vectorized;
use crate::stft::{LONGEST_ROWS, StftParams, magnitude};
use crate::tiles::{LanePlan, for_each_tile, planar, read_columns};
use crate::transform::Forward;

pub use bandwidth::{Bandwidth, spectral_bandwidth};
pub use centroid::{centroid, spectral_centroid};
pub use contrast::{Contrast, ContrastParams, contrast_from_extremes, spectral_contrast};
pub use flatness::{Flatness, spectral_flatness};
pub use poly::{Poly, poly_features};
pub use rolloff::{rolloff, spectral_rolloff};

/// Frequencies in Hz of the rows of a spectrogram.
#[derive(Debug, Clone, Copy)]
pub enum Frequencies<'a> {
    /// One per bin, the same in all frames.
    Bins(&'a [f64]),
    /// One per bin and frame, shaped as the spectrogram (reassigned spectrograms).
    Frames(ArrayView3<'a, f64>),
}

impl Frequencies<'_> {
    /// Refuses frequencies that do not fit a spectrogram `[channels, bins, frames]`.
    fn check(&self, (channels, bins, frames): (usize, usize, usize)) -> Result<()> {
        let (actual, expected) = match self {
            Self::Bins(f) => (vec![f.len()], vec![bins]),
            Self::Frames(f) => (f.shape().to_vec(), vec![channels, bins, frames]),
        };
        if actual == expected {
            return Ok(());
        }
        Err(DspError::Shape { name: "freq", expected: format!("{expected:?}"), actual })
    }

    /// The frequencies of one frame; `buffer` holds them where they have to be gathered.
    fn column<'b>(&'b self, channel: usize, frame: usize, buffer: &'b mut Vec<f64>) -> &'b [f64] {
        match self {
            Self::Bins(f) => f,
            Self::Frames(f) => {
                buffer.clear();
                buffer.extend(f.slice(s![channel, .., frame]));
                buffer
            }
        }
    }
}

/// The magnitude spectra that a feature is computed from.
pub enum Spectra<'a, T: Real> {
    /// A spectrogram `[channels, bins, frames]`.
    Given(ArrayView3<'a, T>),
    /// Those of a signal `[channels, samples]`, by a transform in double precision, a few at a time.
    Of(CowArray<'a, T, Ix2>, Exact),
}

/// A transform of frames in double precision.
pub struct Exact(Kind);

enum Kind {
    Rows(Box<LanePlan<DoubleRow>>),
    /// Of lengths for which rows would take too much memory.
    Single(Box<Forward<f64>>),
}

impl Exact {
    fn new(params: &StftParams) -> Result<Self> {
        Ok(Self(if params.n_fft > LONGEST_ROWS {
            Kind::Single(Box::new(Forward::new(params)?))
        } else {
            Kind::Rows(Box::new(LanePlan::new(params)?))
        }))
    }

    fn params(&self) -> &StftParams {
        match &self.0 {
            Kind::Rows(plan) => plan.params(),
            Kind::Single(forward) => forward.params(),
        }
    }
}

impl<'a, T: Real> From<ArrayView3<'a, T>> for Spectra<'a, T> {
    fn from(spectrogram: ArrayView3<'a, T>) -> Self {
        Self::Given(spectrogram)
    }
}

impl<'a, T: Real> Spectra<'a, T> {
    /// The spectra of the signal `y [channels, samples]`.
    ///
    /// # Errors
    /// Impossible parameters, or a signal too short for one frame.
    pub fn of(y: ArrayView2<'a, T>, params: &StftParams) -> Result<Self> {
        params.shape_of(y)?;
        Ok(Self::Of(planar(y), Exact::new(params)?))
    }

    /// Channels, bins, frames.
    pub fn dim(&self) -> (usize, usize, usize) {
        match self {
            Self::Given(s) => s.dim(),
            Self::Of(y, exact) => {
                let params = exact.params();
                (y.nrows(), params.n_bins(), params.n_frames(y.ncols()))
            }
        }
    }

    /// Refuses negative magnitudes.
    fn require_non_negative(&self) -> Result<()> {
        let Self::Given(s) = self else { return Ok(()) };
        match s.iter().find(|s| **s < T::zero()) {
            None => Ok(()),
            Some(s) => Err(DspError::parameter("S", s.wide(), "0 or more everywhere")),
        }
    }

    /// Refuses non-finite magnitudes.
    fn require_finite(&self) -> Result<()> {
        let Self::Given(s) = self else { return Ok(()) };
        require_finite("S", *s)
    }

    /// Refuses negative and non-finite magnitudes, as the features that normalise a spectrum do.
    fn require_magnitudes(&self) -> Result<()> {
        self.require_finite()?;
        self.require_non_negative()
    }

    /// `[channels, rows, frames]` made by `each(state, channel, frame, magnitudes, out)`, where
    /// `out` holds the `rows` values of that frame; on all threads of the pool, each with a `state`.
    pub(crate) fn map<R: Real, S: Send>(
        &self,
        rows: usize,
        state: impl Fn() -> S + Sync,
        each: impl Fn(&mut S, usize, usize, &[T], &mut [R]) + Sync,
    ) -> Array3<R> {
        let (channels, bins, frames) = self.dim();
        let mut result = Array3::zeros((channels, rows, frames));
        let buffers = || (vec![T::zero(); LANES * bins], vec![R::zero(); rows]);
        match self {
            Self::Given(s) => for_each_tile(
                result.view_mut(),
                || (buffers(), state()),
                |((columns, out), state), mut tile| {
                    let (c, first) = (tile.channel, tile.first);
                    let part = s.slice(s![c, .., first..first + tile.out.ncols()]);
                    for (b, block) in part.axis_chunks_iter(Axis(1), LANES).enumerate() {
                        read_columns(block, columns);
                        for (i, spectrum) in columns.chunks_exact(bins.max(1)).enumerate() {
                            let t = b * LANES + i;
                            if i == block.ncols() {
                                break;
                            }
                            each(state, c, first + t, spectrum, out);
                            tile.out.column_mut(t).iter_mut().zip(&*out).for_each(|(o, x)| *o = *x);
                        }
                    }
                },
            ),
            Self::Of(y, Exact(Kind::Rows(plan))) => for_each_tile(
                result.view_mut(),
                || (buffers(), (plan.frames(), vec![DoubleRow::EMPTY; 2 * bins]), state()),
                |((columns, out), (frames, spectrum), state), mut tile| {
                    let signal = y.row(tile.channel);
                    let signal = signal.to_slice().expect("contiguous");
                    let blocks = tile.out.axis_chunks_iter_mut(Axis(1), DoubleRow::SLOTS);
                    for (b, mut block) in blocks.enumerate() {
                        let first = tile.first + b * DoubleRow::SLOTS;
                        frames.complex(signal, first, spectrum);
                        magnitudes(spectrum, columns);
                        let spectra = columns.chunks_exact(bins).zip(block.columns_mut());
                        for (i, (spectrum, mut column)) in spectra.enumerate() {
                            each(state, tile.channel, first + i, spectrum, out);
                            column.iter_mut().zip(&*out).for_each(|(o, x)| *o = *x);
                        }
                    }
                },
            ),
            Self::Of(y, Exact(Kind::Single(forward))) => for_each_tile(
                result.view_mut(),
                || (buffers(), forward.scratch(), state()),
                |((columns, out), scratch, state), mut tile| {
                    let signal = y.row(tile.channel);
                    let signal = signal.to_slice().expect("contiguous");
                    let spectrum = &mut columns[..bins];
                    for (i, mut column) in tile.out.axis_iter_mut(Axis(1)).enumerate() {
                        let t = tile.first + i;
                        let values = forward.spectrum(signal, t, scratch);
                        for (slot, z) in spectrum.iter_mut().zip(values) {
                            *slot = magnitude(Complex::new(T::of(z.re), T::of(z.im)));
                        }
                        each(state, tile.channel, t, spectrum, out);
                        column.iter_mut().zip(&*out).for_each(|(o, x)| *o = *x);
                    }
                },
            ),
        }
        result
    }
}

/// Magnitudes of a row of frames, frame by frame.
fn magnitudes<T: Real>(spectrum: &[DoubleRow], columns: &mut [T]) {
    let bins = spectrum.len() / 2;
    let columns = &mut columns[..DoubleRow::SLOTS * bins];
    vectorized(
        #[inline(always)]
        || {
            for (k, [re, im]) in spectrum.as_chunks::<2>().0.iter().enumerate() {
                let mut values = [T::zero(); DoubleRow::SLOTS];
                for (value, (re, im)) in values.iter_mut().zip(re.0.iter().zip(&im.0)) {
                    *value = magnitude(Complex::new(T::of(*re), T::of(*im)));
                }
                for (column, value) in columns.chunks_exact_mut(bins).zip(&values) {
                    column[k] = *value;
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frequency::fft_frequencies;
    use ndarray::Array2;

    const BINS: usize = 513;

    fn noise() -> Array3<f32> {
        let mut state = 1_u32;
        Array3::from_shape_simple_fn((3, BINS, 21), || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 1e7
        })
    }

    /// Every feature of a spectrogram, by name.
    fn all(s: ArrayView3<f32>) -> Vec<(&'static str, Array3<f64>)> {
        let freqs = fft_frequencies(22050.0, 1024).unwrap();
        let f = Frequencies::Bins(&freqs);
        let params = ContrastParams { linear: true, ..ContrastParams::default() };
        vec![
            ("centroid", spectral_centroid(s, f).unwrap()),
            ("bandwidth", spectral_bandwidth(s, f, None, Bandwidth::default()).unwrap()),
            ("rolloff", spectral_rolloff(s, f, 0.85).unwrap()),
            ("flatness", spectral_flatness(s, Flatness::default()).unwrap().mapv(f64::from)),
            ("contrast", spectral_contrast(s, &freqs, 22050.0, &params).unwrap()),
            ("poly", poly_features(s, f, 2).unwrap().0),
        ]
    }

    #[test]
    fn spectra_of_a_signal_are_its_spectrogram() {
        let y = Array2::from_shape_fn((2, 5000), |(c, i)| ((i * i + c) % 101) as f32 / 50.0 - 1.0);
        let freqs = fft_frequencies(22050.0, 1024).unwrap();
        let stft = StftParams::new(1024, 300);
        let s = crate::stft::spectrogram(y.view(), &stft, 1.0).unwrap();
        let of = || Spectra::of(y.view(), &stft).unwrap();
        assert_eq!(of().dim(), s.dim());
        assert_eq!(
            spectral_centroid(of(), Frequencies::Bins(&freqs)).unwrap(),
            spectral_centroid(s.view(), Frequencies::Bins(&freqs)).unwrap()
        );
        let params = ContrastParams::default();
        assert_eq!(
            spectral_contrast(of(), &freqs, 22050.0, &params).unwrap(),
            spectral_contrast(s.view(), &freqs, 22050.0, &params).unwrap()
        );
    }

    #[test]
    fn channels_are_independent() {
        let s = noise();
        let together = all(s.view());
        for c in 0..3 {
            let alone = all(s.slice(s![c..c + 1, .., ..]));
            for ((name, a), (_, b)) in together.iter().zip(&alone) {
                assert_eq!(a.slice(s![c..c + 1, .., ..]), b, "{name}");
            }
        }
    }

    #[test]
    fn frames_are_independent() {
        let s = noise();
        let together = all(s.view());
        let alone = all(s.slice(s![.., .., 17..18]));
        for ((name, a), (_, b)) in together.iter().zip(&alone) {
            assert_eq!(a.slice(s![.., .., 17..18]), b, "{name}");
        }
    }

    #[test]
    fn silence_is_finite() {
        for (name, a) in all(Array3::zeros((1, BINS, 2)).view()) {
            let want = if name == "flatness" { 1.0 } else { 0.0 };
            assert!(a.iter().all(|x| (x - want).abs() < 1e-6), "{name}: {a}");
        }
    }

    #[test]
    fn no_frames_give_no_values() {
        for (name, a) in all(Array3::zeros((2, BINS, 0)).view()) {
            assert_eq!(a.len_of(Axis(2)), 0, "{name}");
        }
    }

    #[test]
    fn negative_and_non_finite_magnitudes_are_refused() {
        let freqs = fft_frequencies(22050.0, 1024).unwrap();
        for bad in [-1.0, f32::NAN, f32::INFINITY] {
            let mut s = noise();
            s[[1, 2, 3]] = bad;
            assert!(spectral_centroid(s.view(), Frequencies::Bins(&freqs)).is_err(), "{bad}");
        }
    }

    #[test]
    fn frequencies_must_fit() {
        let s = noise();
        let error = spectral_centroid(s.view(), Frequencies::Bins(&[1.0, 2.0])).unwrap_err();
        assert_eq!(error.to_string(), "freq has shape [2], expected [513]");
        let per_frame = Array3::<f64>::ones((3, BINS, 20));
        assert!(spectral_rolloff(s.view(), Frequencies::Frames(per_frame.view()), 0.85).is_err());
    }

    #[test]
    fn frequencies_per_frame_are_those_of_the_frame() {
        let s = noise();
        let freqs = fft_frequencies(22050.0, 1024).unwrap();
        let per_frame = Array3::from_shape_fn(s.raw_dim(), |(_, k, _)| freqs[k]);
        let (bins, frames) = (Frequencies::Bins(&freqs), Frequencies::Frames(per_frame.view()));
        assert_eq!(
            spectral_centroid(s.view(), bins).unwrap(),
            spectral_centroid(s.view(), frames).unwrap()
        );
        assert_eq!(
            poly_features(s.view(), bins, 1).unwrap(),
            poly_features(s.view(), frames, 1).unwrap()
        );
    }
}
