//! Chroma filter bank and chromagram (librosa 0.11 `filters.chroma`, `feature.chroma_stft`).

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, Axis};

use crate::error::{DspError, Result};
use crate::frequency::{hz_to_octs, require_rate};
use crate::normalize::Norm;
use crate::real::{Real, require_finite};
use crate::simd::vectorized;
use crate::spectral::Spectra;
use crate::sums;

/// Parameters of a chroma filter bank, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChromaParams {
    /// Sample rate in Hz.
    pub sr: f64,
    /// Length of the transform in samples, at least 2.
    pub n_fft: usize,
    /// Pitch classes per octave.
    pub n_chroma: usize,
    /// Deviation from A440 in fractions of a pitch class.
    pub tuning: f64,
    /// Centre of the Gaussian weighting of octaves, in octaves above 27.5 Hz.
    pub ctroct: f64,
    /// Half width of that weighting in octaves; `None` weighs all octaves alike.
    pub octwidth: Option<f64>,
    /// Normalisation of each bin's column, before the octaves are weighted.
    pub norm: Option<Norm>,
    /// Rows start at C instead of A.
    pub base_c: bool,
}

impl ChromaParams {
    /// librosa's defaults: 12 classes from C, untuned.
    pub fn new(sr: f64, n_fft: usize) -> Self {
        Self {
            sr,
            n_fft,
            n_chroma: 12,
            tuning: 0.0,
            ctroct: 5.0,
            octwidth: Some(2.0),
            norm: Some(Norm::P(2.0)),
            base_c: true,
        }
    }

    fn check(&self) -> Result<()> {
        require_rate(self.sr)?;
        if self.n_fft < 2 {
            return Err(DspError::parameter("n_fft", self.n_fft, "at least 2"));
        }
        if self.n_chroma == 0 {
            return Err(DspError::parameter("n_chroma", 0, "at least 1"));
        }
        for (name, value) in [("tuning", self.tuning), ("ctroct", self.ctroct)] {
            if !value.is_finite() {
                return Err(DspError::parameter(name, value, "finite"));
            }
        }
        match self.octwidth {
            Some(width) if !(width.is_finite() && width != 0.0) => {
                Err(DspError::parameter("octwidth", width, "above 0, or none"))
            }
            _ => Ok(()),
        }
    }
}

/// The filter bank `[n_chroma, n_fft / 2 + 1]`; librosa's is `f32` unless it is asked for another.
///
/// # Errors
/// Impossible parameters.
pub fn chroma_filter<T: Real>(p: &ChromaParams) -> Result<Array2<T>> {
    p.check()?;
    let classes = p.n_chroma as f64;
    let step = p.sr / p.n_fft as f64;
    let above_dc = |i: usize| classes * hz_to_octs(i as f64 * step, p.tuning, p.n_chroma);
    // The 0 Hz bin stands an octave and a half below the next.
    let position = |i: usize| if i == 0 { above_dc(1) - 1.5 * classes } else { above_dc(i) };
    let half = (classes / 2.0).round_ties_even();
    let first_row = if p.base_c { 3 * (p.n_chroma / 12) } else { 0 };
    let mut column = vec![0.0; p.n_chroma];
    let mut bank = Array2::zeros((p.n_chroma, p.n_fft / 2 + 1));
    for (i, mut bin) in bank.axis_iter_mut(Axis(1)).enumerate() {
        let here = position(i);
        let width = if i + 1 < p.n_fft { (position(i + 1) - here).max(1.0) } else { 1.0 };
        for (class, weight) in column.iter_mut().enumerate() {
            let distance = (here - class as f64 + half + 10.0 * classes).rem_euclid(classes) - half;
            *weight = (-0.5 * (2.0 * distance / width).powi(2)).exp();
        }
        if let Some(norm) = p.norm {
            norm.normalize(&mut column);
        }
        let octave = |width: f64| (-0.5 * ((here / classes - p.ctroct) / width).powi(2)).exp();
        let level = p.octwidth.map_or(1.0, octave);
        for (row, slot) in bin.iter_mut().enumerate() {
            *slot = T::of(column[(row + first_row) % p.n_chroma] * level);
        }
    }
    Ok(bank)
}

/// A filter bank ready to be applied to single spectra.
#[derive(Debug, Clone)]
pub struct Chroma<T> {
    /// `[n_chroma, bins]`, row after row.
    weights: Vec<T>,
    n_chroma: usize,
    bins: usize,
    norm: Option<Norm>,
}

impl<T: Real> Chroma<T> {
    /// Applies `bank [n_chroma, bins]` and normalises each frame by `norm`.
    pub fn new(bank: ArrayView2<T>, norm: Option<Norm>) -> Self {
        let (n_chroma, bins) = bank.dim();
        Self { weights: bank.iter().copied().collect(), n_chroma, bins, norm }
    }

    /// Pitch classes of one spectrum of `bins` powers (or magnitudes) into `out`; silence is 0.
    pub fn frame(&self, spectrum: &[T], out: &mut [T]) {
        let row = |class: usize| &self.weights[class * self.bins..(class + 1) * self.bins];
        let spectrum = &spectrum[..self.bins];
        vectorized(
            #[inline(always)]
            || {
                let (fours, rest) = out.as_chunks_mut::<4>();
                let single = 4 * fours.len();
                for (i, four) in fours.iter_mut().enumerate() {
                    let class = 4 * i;
                    let rows = [row(class), row(class + 1), row(class + 2), row(class + 3)];
                    *four = sums::dots(rows, spectrum);
                }
                for (i, slot) in rest.iter_mut().enumerate() {
                    [*slot] = sums::dots([row(single + i)], spectrum);
                }
            },
        );
        if let Some(norm) = self.norm {
            norm.normalize(out);
        }
    }

    /// Chromagram `[channels, n_chroma, frames]` of a spectrogram.
    ///
    /// # Errors
    /// A spectrogram of other bins, or (when normalised) non-finite values.
    pub fn chromagram(&self, s: ArrayView3<T>) -> Result<Array3<T>> {
        if s.dim().1 != self.bins {
            let expected = format!("{} bins", self.bins);
            return Err(DspError::Shape { name: "S", expected, actual: s.shape().to_vec() });
        }
        if self.norm.is_some() {
            require_finite("S", s)?;
        }
        let frame = |(): &mut (), _, _, spectrum: &[T], out: &mut [T]| self.frame(spectrum, out);
        Ok(Spectra::from(s).map(self.n_chroma, || (), frame))
    }
}

/// Chromagram `[channels, n_chroma, frames]` of a spectrogram under a filter bank.
///
/// # Errors
/// As [`Chroma::chromagram`].
pub fn chroma<T: Real>(
    s: ArrayView3<T>,
    bank: ArrayView2<T>,
    norm: Option<Norm>,
) -> Result<Array3<T>> {
    Chroma::new(bank, norm).chromagram(s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::s;

    /// Power spectrogram of one line per frame, at these bins.
    fn lines(bins: &[usize]) -> Array3<f32> {
        let mut s = Array3::zeros((1, 1025, bins.len()));
        bins.iter().enumerate().for_each(|(t, k)| s[[0, *k, t]] = 1.0);
        s
    }

    #[test]
    fn octaves_fall_into_one_class() {
        let p = ChromaParams::new(22050.0, 2048);
        let bank = chroma_filter::<f32>(&p).unwrap();
        // 440 Hz and its octaves: A is row 9 when rows start at C, and row 0 otherwise.
        let s = lines(&[41, 82, 163]);
        let c = chroma(s.view(), bank.view(), Some(Norm::Max)).unwrap();
        assert!((0..3).all(|t| c[[0, 9, t]] == 1.0), "{c}");
        let from_a = chroma_filter::<f32>(&ChromaParams { base_c: false, ..p }).unwrap();
        let c = chroma(s.view(), from_a.view(), Some(Norm::Max)).unwrap();
        assert!((0..3).all(|t| c[[0, 0, t]] == 1.0), "{c}");
    }

    #[test]
    fn silence_stays_silence() {
        let bank = chroma_filter::<f64>(&ChromaParams::new(16000.0, 64)).unwrap();
        let c = chroma(Array3::zeros((2, 33, 4)).view(), bank.view(), Some(Norm::Max)).unwrap();
        assert_eq!(c, Array3::zeros((2, 12, 4)));
    }

    #[test]
    fn channels_are_independent() {
        let bank = chroma_filter::<f32>(&ChromaParams::new(16000.0, 64)).unwrap();
        let x = Array3::from_shape_fn((3, 33, 20), |(c, k, t)| ((c * 31 + k * 7 + t) % 13) as f32);
        let both = chroma(x.view(), bank.view(), Some(Norm::Max)).unwrap();
        let alone = chroma(x.slice(s![1..2, .., ..]), bank.view(), Some(Norm::Max)).unwrap();
        assert_eq!(both.slice(s![1..2, .., ..]), alone);
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let p = ChromaParams::new(16000.0, 64);
        for bad in [
            ChromaParams { n_fft: 1, ..p },
            ChromaParams { n_chroma: 0, ..p },
            ChromaParams { sr: -1.0, ..p },
            ChromaParams { tuning: f64::NAN, ..p },
            ChromaParams { octwidth: Some(0.0), ..p },
        ] {
            assert!(chroma_filter::<f32>(&bad).is_err(), "{bad:?}");
        }
        let bank = chroma_filter::<f32>(&p).unwrap();
        assert!(chroma(Array3::zeros((1, 32, 1)).view(), bank.view(), None).is_err());
    }
}
