//! Pitch tracking by parabolic interpolation, and tuning (librosa 0.11 `piptrack`,
//! `estimate_tuning`, `pitch_tuning`).

mod tracks;

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3};

use crate::error::{DspError, Result};
use crate::frequency::fft_frequencies;
use crate::log2::log2;
use crate::real::Real;
use crate::simd::vectorized;
use crate::sums::largest;

pub use tracks::piptrack;

/// Parameters of the tracker, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PitchParams {
    /// Sample rate in Hz.
    pub sr: f64,
    /// Length of the transform in samples.
    pub n_fft: usize,
    /// Lowest frequency in Hz, inclusive.
    pub fmin: f64,
    /// Highest frequency in Hz, exclusive; at most `sr / 2` is used.
    pub fmax: f64,
    /// Fraction of a spectrum's maximum that peaks exceed.
    pub threshold: f64,
}

impl PitchParams {
    /// librosa's defaults: 150 to 4000 Hz, a tenth of the maximum.
    pub fn new(sr: f64, n_fft: usize) -> Self {
        Self { sr, n_fft, fmin: 150.0, fmax: 4000.0, threshold: 0.1 }
    }
}

/// A spectral peak between bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak<T> {
    /// Bin of the local maximum.
    pub bin: usize,
    /// Interpolated frequency in Hz.
    pub pitch: T,
    /// Interpolated magnitude.
    pub magnitude: T,
}

/// Finds the peaks of spectra.
#[derive(Debug, Clone)]
pub struct PitchTracker {
    params: PitchParams,
    /// Bins with `fmin <= f < fmax`, `first..end`.
    first: usize,
    end: usize,
}

impl PitchTracker {
    /// # Errors
    /// `sr <= 0` or `n_fft < 2` (interpolation needs two bins).
    pub fn new(params: PitchParams) -> Result<Self> {
        let freqs = fft_frequencies(params.sr, params.n_fft)?;
        if freqs.len() < 2 {
            return Err(DspError::parameter("n_fft", params.n_fft, "at least 2"));
        }
        let (fmin, fmax) = (params.fmin.max(0.0), params.fmax.min(params.sr / 2.0));
        let first = freqs.partition_point(|f| *f < fmin);
        let end = freqs.partition_point(|f| *f < fmax);
        Ok(Self { params, first, end })
    }

    /// Bins that peaks are looked for in and their neighbours: the length of spectrum that
    /// [`peaks`](Self::peaks) needs when it is given a reference.
    pub fn reach(&self) -> usize {
        (self.end + 1).min(self.n_bins())
    }

    /// Bins of a spectrum, `n_fft / 2 + 1`.
    pub fn n_bins(&self) -> usize {
        self.params.n_fft / 2 + 1
    }

    /// Bins that may be a peak: not the first, and the last only has a left neighbour.
    fn bins(&self) -> Range<usize> {
        let first = self.first.max(1);
        first..self.end.max(first)
    }

    /// Calls `each` with the peaks of one spectrum of non-negative magnitudes (or powers), in bin
    /// order. Peaks exceed `reference`, or `threshold` times the maximum where that is `None`.
    ///
    /// With a reference, [`reach`](Self::reach) bins are enough.
    pub fn peaks<T: Real>(
        &self,
        magnitude: &[T],
        reference: Option<T>,
        mut each: impl FnMut(Peak<T>),
    ) {
        let reference = reference.unwrap_or_else(|| {
            let largest = vectorized(
                #[inline(always)]
                || largest(magnitude),
            );
            T::of(self.params.threshold) * largest
        });
        let Range { start, end } = self.bins();
        let (first, end) = (start, end.min(magnitude.len()));
        // Most bins are far below the reference: many are looked at together.
        let low = |bins: &[T]| bins.iter().fold(true, |low, s| low & (*s <= reference));
        let blocks = (first..end).step_by(AT_ONCE).map(|k| k..end.min(k + AT_ONCE));
        for k in blocks.filter(|bins| !low(&magnitude[bins.clone()])).flatten() {
            let right = magnitude.get(k + 1).copied();
            if let Some(peak) = self.peak(k, (magnitude[k - 1], magnitude[k], right), reference) {
                each(peak);
            }
        }
    }

    /// The peak at `bin`, if its magnitude is one: between those of its neighbours, the last of which has no
    /// upper one.
    #[inline(always)]
    fn peak<T: Real>(
        &self,
        bin: usize,
        (left, here, right): (T, T, Option<T>),
        reference: T,
    ) -> Option<Peak<T>> {
        let kept = |s: T| if s > reference { s } else { T::zero() };
        // Not where the reference is NaN.
        let exceeds = here > reference;
        if !exceeds || here <= kept(left) || right.is_some_and(|right| here < kept(right)) {
            return None;
        }
        let (mut shift, mut skew) = (T::zero(), T::zero());
        if let Some(right) = right {
            // Sums of neighbours round to T, the rest is double, as numba types librosa's code.
            let curvature = (right + left).wide() - 2.0 * here.wide();
            let slope = (right - left).wide() / 2.0;
            if slope.abs() < curvature.abs() {
                shift = T::of(-slope / curvature);
            }
            skew = T::of(0.5) * ((right - left) / T::of(2.0)) * shift;
        }
        let place = bin as f64 + shift.wide();
        let pitch = T::of(place * self.params.sr / self.params.n_fft as f64);
        Some(Peak { bin, pitch, magnitude: here + skew })
    }
}

/// Bins that are compared with the reference together.
const AT_ONCE: usize = 16;

/// Refuses spectrograms and references whose shapes are not those of the tracker.
fn check<T>(
    tracker: &PitchTracker,
    s: ArrayView3<T>,
    reference: Option<ArrayView2<T>>,
) -> Result<()> {
    let (channels, bins, frames) = s.dim();
    if bins != tracker.n_bins() {
        let expected = format!("{} bins", tracker.n_bins());
        return Err(DspError::Shape { name: "S", expected, actual: s.shape().to_vec() });
    }
    match reference {
        Some(given) if given.dim() != (channels, frames) => {
            let expected = format!("[{channels}, {frames}]");
            Err(DspError::Shape { name: "ref", expected, actual: given.shape().to_vec() })
        }
        _ => Ok(()),
    }
}

/// Collects the peaks of a recording and finds its tuning when all are known.
#[derive(Debug, Clone)]
pub struct TuningEstimator<T> {
    tracker: PitchTracker,
    pitches: Vec<T>,
    magnitudes: Vec<T>,
}

impl<T: Real> TuningEstimator<T> {
    /// # Errors
    /// As [`PitchTracker::new`].
    pub fn new(params: PitchParams) -> Result<Self> {
        Ok(Self::of(PitchTracker::new(params)?))
    }

    fn of(tracker: PitchTracker) -> Self {
        Self { tracker, pitches: Vec::new(), magnitudes: Vec::new() }
    }

    /// The tracker after it.
    pub fn tracker(&self) -> &PitchTracker {
        &self.tracker
    }

    /// Adds the peaks of one spectrum of non-negative magnitudes or powers.
    pub fn push(&mut self, magnitude: &[T], reference: Option<T>) {
        let tracker = self.tracker.clone();
        tracker.peaks(magnitude, reference, |peak| self.add(peak));
    }

    fn add(&mut self, peak: Peak<T>) {
        // A magnitude that is no number has no place among the others.
        if peak.pitch > T::zero() && !peak.magnitude.is_nan() {
            self.pitches.push(peak.pitch);
            self.magnitudes.push(peak.magnitude);
        }
    }

    /// Takes over the peaks of `other`, for channels that were tracked separately.
    pub fn merge(&mut self, other: Self) {
        self.pitches.extend(other.pitches);
        self.magnitudes.extend(other.magnitudes);
    }

    /// Tuning of the peaks at or above their median magnitude, as [`pitch_tuning`]; `None` where
    /// there are no peaks (librosa warns and returns 0).
    ///
    /// # Errors
    /// As [`pitch_tuning`].
    pub fn finish(mut self, resolution: f64, bins_per_octave: usize) -> Result<Option<f64>> {
        let mut magnitudes = self.magnitudes.clone();
        if let Some(median) = median(&mut magnitudes) {
            let mut magnitude = self.magnitudes.iter();
            self.pitches.retain(|_| magnitude.next().is_some_and(|m| *m >= median));
        }
        pitch_tuning(&self.pitches, resolution, bins_per_octave)
    }
}

/// Median as `numpy.median` takes it: the mean, in `T`, of the middle two for even counts.
fn median<T: Real>(values: &mut [T]) -> Option<T> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let order = |a: &T, b: &T| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal);
    let odd = values.len() % 2 == 1;
    let (below, high, _) = values.select_nth_unstable_by(middle, order);
    if odd {
        return Some(*high);
    }
    let low = below.iter().fold(T::neg_infinity(), |m, x| x.max(m));
    Some((low + *high) / T::of(2.0))
}

/// Tuning of a spectrogram `[channels, bins, frames]` in fractions of a bin, one for all channels
/// and frames (`estimate_tuning`); `None` where it has no peaks.
///
/// # Errors
/// As [`piptrack`] and [`pitch_tuning`].
pub fn estimate_tuning<T: Real>(
    s: ArrayView3<T>,
    reference: Option<ArrayView2<T>>,
    params: PitchParams,
    resolution: f64,
    bins_per_octave: usize,
) -> Result<Option<f64>> {
    let mut estimator = TuningEstimator::new(params)?;
    check(&estimator.tracker, s, reference)?;
    tracks::collect(&mut estimator, s, reference);
    estimator.finish(resolution, bins_per_octave)
}

/// Offset of `frequencies` (Hz) from equal temperament at A440, in fractions of a bin in
/// [-0.5, 0.5): the lower edge of the first fullest cell of a histogram with cells of `resolution`
/// (`pitch_tuning`). Frequencies at or below 0 do not count; `None` where none is left.
///
/// # Errors
/// `resolution` outside (0, 1) or too small for a histogram, or `bins_per_octave = 0`.
pub fn pitch_tuning<T: Real>(
    frequencies: &[T],
    resolution: f64,
    bins_per_octave: usize,
) -> Result<Option<f64>> {
    const FINEST: f64 = 1e-6;
    if !(FINEST..=1.0).contains(&resolution) {
        return Err(DspError::parameter("resolution", resolution, format!("{FINEST} to 1")));
    }
    if bins_per_octave == 0 {
        return Err(DspError::parameter("bins_per_octave", 0, "at least 1"));
    }
    let cells = (1.0 / resolution).ceil();
    let edge = |i: usize| i as f64 * (1.0 / cells) - 0.5;
    let mut counts = vec![0_u64; cells as usize];
    let per_octave = T::of(bins_per_octave as f64);
    let mut any = false;
    for f in frequencies.iter().filter(|f| **f > T::zero() && f.is_finite()) {
        any = true;
        // Each step rounds to T, as in numpy.
        let bins = per_octave * octaves(*f / T::of(27.5));
        let mut residual = bins - bins.floor();
        if residual >= T::of(0.5) {
            residual -= T::one();
        }
        let residual = residual.wide();
        let mut cell = (((residual + 0.5) * cells) as usize).min(counts.len() - 1);
        while cell > 0 && residual < edge(cell) {
            cell -= 1;
        }
        while cell + 1 < counts.len() && residual >= edge(cell + 1) {
            cell += 1;
        }
        counts[cell] += 1;
    }
    let fullest = counts.iter().copied().max().unwrap_or(0);
    let first = counts.iter().position(|n| *n == fullest).unwrap_or(0);
    Ok(any.then(|| edge(first)))
}

/// Binary logarithm of `ratio`, rounded to `T` as numpy does.
fn octaves<T: Real>(ratio: T) -> T {
    match T::as_f32(&[ratio]) {
        Some(single) => T::of(f64::from(log2(single[0]))),
        None => ratio.log2(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, Axis};

    /// A spectrogram of one frame with parabolic peaks of height `h` around `bin`.
    fn peaks(n_bins: usize, places: &[(f64, f64)]) -> Array3<f64> {
        Array3::from_shape_fn((1, n_bins, 1), |(_, k, _)| {
            let hill = |(bin, h): &(f64, f64)| h * (1.0 - 0.1 * (k as f64 - bin).powi(2)).max(0.0);
            places.iter().map(hill).sum()
        })
    }

    #[test]
    fn a_parabola_is_found_between_bins() {
        let params = PitchParams::new(22050.0, 2048);
        let s = peaks(1025, &[(100.3, 2.0), (200.0, 0.1), (300.0, 1.0)]);
        let (pitches, magnitudes) = piptrack(s.view(), None, params).unwrap();
        let found: Vec<usize> = (0..1025).filter(|k| pitches[[0, *k, 0]] > 0.0).collect();
        assert_eq!(found, [100, 300]);
        assert!((pitches[[0, 100, 0]] - 100.3 * 22050.0 / 2048.0).abs() < 1e-9);
        // Twice the parabola's rise from bin to vertex is not added: librosa's skew overshoots.
        assert!((magnitudes[[0, 100, 0]] - 2.0).abs() < 0.02);
        assert!(piptrack(s.view(), None, PitchParams::new(22050.0, 1024)).is_err());
    }

    #[test]
    fn tuning_pools_channels_and_keeps_the_louder_half() {
        let params = PitchParams { fmax: 8000.0, ..PitchParams::new(22050.0, 2048) };
        let bin = |tuning: f64, note: f64| {
            440.0 * 2.0_f64.powf((note + tuning) / 12.0) * 2048.0 / 22050.0
        };
        let loud = peaks(1025, &[(bin(0.255, 0.0), 1.0), (bin(0.255, 12.0), 1.0)]);
        let soft = peaks(1025, &[(bin(-0.355, 0.0), 0.5), (bin(-0.355, 12.0), 0.5)]);
        let both = ndarray::concatenate(Axis(0), &[soft.view(), loud.view()]).unwrap();
        let tuning = |s: &Array3<f64>| estimate_tuning(s.view(), None, params, 0.01, 12).unwrap();
        assert!((tuning(&both).unwrap() - 0.25).abs() < 1e-12);
        assert!((tuning(&soft).unwrap() + 0.36).abs() < 1e-12);
        assert_eq!(tuning(&Array3::zeros((2, 1025, 3))), None);
    }

    #[test]
    fn streaming_equals_the_whole() {
        let params = PitchParams::new(22050.0, 64);
        let s =
            Array3::from_shape_fn((2, 33, 50), |(c, k, t)| ((c + 7 * k * k + 3 * t) % 29) as f32);
        let mut merged = TuningEstimator::new(params).unwrap();
        for channel in s.outer_iter() {
            let mut one = TuningEstimator::new(params).unwrap();
            for t in 0..50 {
                one.push(&channel.column(t).to_vec(), None);
            }
            merged.merge(one);
        }
        let whole = estimate_tuning(s.view(), None, params, 0.01, 12).unwrap();
        assert!(whole.is_some());
        assert_eq!(merged.finish(0.01, 12).unwrap(), whole);
    }

    #[test]
    fn histogram_cells_are_closed_below() {
        assert_eq!(pitch_tuning(&[440.0_f64], 0.01, 12).unwrap(), Some(0.0));
        assert_eq!(pitch_tuning(&[0.0_f64, -3.0], 0.01, 12).unwrap(), None);
        assert!(pitch_tuning(&[440.0_f64], 0.0, 12).is_err());
        assert!(pitch_tuning(&[440.0_f64], 0.01, 0).is_err());
    }
}
