//! Onset strength and onset detection (librosa 0.11 `onset`, `util.peak_pick`).

use std::ops::Range;

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, CowArray, Ix3, s};

use crate::decibel::larger;
use crate::error::{DspError, Result};
use crate::frequency::require_rate;
use crate::real::Real;
use crate::simd::vectorized;

/// Bounds the zeros that an envelope starts with.
const MAX_LAG: usize = 1 << 24;

/// Parameters of the onset strength, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnsetParams {
    /// Frames between a spectrum and the one it is compared with.
    pub lag: usize,
    /// Bands of the maximum filter over the earlier spectrum; 1: no filter.
    pub max_size: usize,
    /// Frames by which the analysis is centred, `n_fft / (2 * hop_length)`: the envelope is
    /// delayed by as many and cut to the frames of the spectrogram. `None` does neither.
    pub center: Option<usize>,
}

impl OnsetParams {
    /// librosa's defaults for spectra of this transform length and hop.
    pub fn new(n_fft: usize, hop_length: usize) -> Result<Self> {
        let center = n_fft
            .checked_div(2 * hop_length)
            .ok_or_else(|| DspError::parameter("hop_length", 0, "at least 1"))?;
        Ok(Self { lag: 1, max_size: 1, center: Some(center) })
    }

    /// Refuses an impossible lag or size.
    ///
    /// # Errors
    /// `lag` or `max_size` 0, or a lag beyond 2^24.
    pub fn check(&self) -> Result<()> {
        if !(1..=MAX_LAG).contains(&self.lag) {
            return Err(DspError::parameter("lag", self.lag, format!("1 to {MAX_LAG}")));
        }
        if self.max_size == 0 {
            return Err(DspError::parameter("max_size", 0, "at least 1"));
        }
        Ok(())
    }

    /// Zeros before the first comparison, and the length of the envelope of `frames` spectra.
    fn layout(&self, frames: usize) -> (usize, usize) {
        let before = self.lag.saturating_add(self.center.unwrap_or(0));
        let whole = before.saturating_add(frames.saturating_sub(self.lag));
        (before, if self.center.is_some() { whole.min(frames) } else { whole })
    }
}

/// Maximum over `size` bands around each band, the window reaching further down when even.
pub fn max_filter<T: Real>(spectrum: &[T], size: usize, out: &mut [T]) {
    for (k, slot) in out.iter_mut().enumerate() {
        let window = &spectrum[window(k, size, spectrum.len())];
        *slot = window.iter().fold(T::neg_infinity(), |most, x| larger(*x, most));
    }
}

/// What has risen; NaN stays NaN.
#[inline(always)]
fn risen<T: Real>(difference: T) -> T {
    if difference < T::zero() { T::zero() } else { difference }
}

/// The `size` of `bands` bands around band `k`.
fn window(k: usize, size: usize, bands: usize) -> Range<usize> {
    let below = size / 2;
    k.saturating_sub(below)..k.saturating_add(size - below).min(bands)
}

/// The earlier spectra that `spectrogram` is compared with, of the same shape, in C order.
fn references<'a, T: Real>(
    spectrogram: ArrayView3<'a, T>,
    reference: Option<ArrayView3<'a, T>>,
    max_size: usize,
) -> Result<CowArray<'a, T, Ix3>> {
    let given = reference.unwrap_or(spectrogram);
    if given.dim() != spectrogram.dim() {
        let expected = format!("{:?}", spectrogram.shape());
        return Err(DspError::Shape { name: "ref", expected, actual: given.shape().to_vec() });
    }
    let (filtered, bands) = (reference.is_none() && max_size > 1, given.dim().1);
    if !filtered {
        return Ok(in_c_order(given));
    }
    let mut highest = Array3::from_elem(given.raw_dim(), T::neg_infinity());
    for (mut highest, given) in highest.outer_iter_mut().zip(given.outer_iter()) {
        for (k, mut highest) in highest.outer_iter_mut().enumerate() {
            for band in given.slice(s![window(k, max_size, bands), ..]).outer_iter() {
                highest.zip_mut_with(&band, |high, x| *high = larger(*x, *high));
            }
        }
    }
    Ok(highest.into())
}

fn in_c_order<T: Real>(array: ArrayView3<T>) -> CowArray<T, Ix3> {
    match array.is_standard_layout() {
        true => array.into(),
        false => array.as_standard_layout().into_owned().into(),
    }
}

/// What rose in each band, `[channels, bands, frames - lag]`: the onset strength before bands are
/// aggregated.
///
/// # Errors
/// As [`onset_strength`].
pub fn onset_rises<T: Real>(
    spectrogram: ArrayView3<T>,
    reference: Option<ArrayView3<T>>,
    params: &OnsetParams,
) -> Result<Array3<T>> {
    params.check()?;
    let given = reference.as_ref().map(ArrayView3::view);
    let earlier = references(spectrogram.view(), given, params.max_size)?;
    let (channels, bands, frames) = spectrogram.dim();
    let kept = frames.saturating_sub(params.lag);
    let mut rises = Array3::zeros((channels, bands, kept));
    if kept > 0 {
        let (now, earlier) = (spectrogram.slice(s![.., .., params.lag..]), &earlier);
        let earlier = earlier.slice(s![.., .., ..kept]);
        ndarray::Zip::from(&mut rises)
            .and(now)
            .and(earlier)
            .for_each(|rise, now, earlier| *rise = risen(*now - *earlier));
    }
    Ok(rises)
}

/// Onset strength envelope `[channels, frames]` of a spectrogram in dB `[channels, bands, frames]`.
/// `reference` of the same shape replaces the (filtered) spectrogram that it is compared with.
///
/// # Errors
/// `lag` or `max_size` 0, no bands, or a reference of another shape.
pub fn onset_strength<T: Real>(
    spectrogram: ArrayView3<T>,
    reference: Option<ArrayView3<T>>,
    params: &OnsetParams,
) -> Result<Array2<T>> {
    params.check()?;
    let (channels, bands, frames) = spectrogram.dim();
    if bands == 0 {
        let expected = "at least one band".into();
        let actual = spectrogram.shape().to_vec();
        return Err(DspError::Shape { name: "S", expected, actual });
    }
    let given = reference.as_ref().map(ArrayView3::view);
    let earlier = references(spectrogram.view(), given, params.max_size)?;
    let now = in_c_order(spectrogram);
    let (before, length) = params.layout(frames);
    let mut envelope = Array2::zeros((channels, length));
    let mut sums = vec![0.0; length.saturating_sub(before)];
    for (c, mut envelope) in envelope.outer_iter_mut().enumerate() {
        sums.fill(0.0);
        // Band by band: a frame has its bands in order.
        for k in 0..bands {
            let (now, earlier) = (now.slice(s![c, k, ..]), earlier.slice(s![c, k, ..]));
            let now = &now.to_slice().expect("in C order")[params.lag.min(frames)..];
            let earlier = earlier.to_slice().expect("in C order");
            vectorized(
                #[inline(always)]
                || {
                    for (sum, (now, earlier)) in sums.iter_mut().zip(now.iter().zip(earlier)) {
                        *sum += risen(*now - *earlier).wide();
                    }
                },
            );
        }
        let slots = envelope.iter_mut().skip(before);
        slots.zip(&sums).for_each(|(slot, sum)| *slot = T::of(sum / bands as f64));
    }
    Ok(envelope)
}

/// Removes the constant part of envelopes `[channels, frames]`: `y[t] = x[t] - x[t-1] + 0.99 y[t-1]`.
pub fn detrend<T: Real>(envelope: ArrayView2<T>) -> Array2<f64> {
    let mut out = envelope.mapv(T::wide);
    for mut row in out.rows_mut() {
        let (mut x1, mut y1) = (0.0, 0.0);
        for y in &mut row {
            let x = *y;
            *y = x + (0.99 * y1 - x1);
            (x1, y1) = (x, *y);
        }
    }
    out
}

/// Conditions for a peak of an onset envelope (`util.peak_pick`), all in frames but `delta`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeakPick {
    /// Frames before a peak that do not exceed it.
    pub pre_max: usize,
    /// Frames from a peak on (itself included) that do not exceed it.
    pub post_max: usize,
    /// Frames before a peak that count for the mean.
    pub pre_avg: usize,
    /// Frames from a peak on (itself included) that count for the mean.
    pub post_avg: usize,
    /// What a peak has above that mean.
    pub delta: f64,
    /// Frames skipped after a peak.
    pub wait: usize,
}

impl PeakPick {
    /// librosa's defaults for onsets: 30 ms without a higher value, 100 ms of mean on either side,
    /// 30 ms wait.
    ///
    /// # Errors
    /// `sr <= 0` or `hop_length = 0`.
    pub fn new(sr: f64, hop_length: usize) -> Result<Self> {
        require_rate(sr)?;
        if hop_length == 0 {
            return Err(DspError::parameter("hop_length", 0, "at least 1"));
        }
        let hop = hop_length as f64;
        // Python's floor division of floats.
        let frames = |seconds: f64| {
            let samples = seconds * sr;
            ((samples - samples % hop) / hop).round() as usize
        };
        let (short, long) = (frames(0.03), frames(0.10));
        Ok(Self {
            pre_max: short,
            post_max: 1,
            pre_avg: long,
            post_avg: long.saturating_add(1),
            delta: 0.07,
            wait: short,
        })
    }

    fn check(&self) -> Result<()> {
        for (name, value) in [("post_max", self.post_max), ("post_avg", self.post_avg)] {
            if value == 0 {
                return Err(DspError::parameter(name, 0, "at least 1"));
            }
        }
        if self.delta >= 0.0 {
            Ok(())
        } else {
            Err(DspError::parameter("delta", self.delta, "0 or more"))
        }
    }

    /// Frames of the peaks of `x`, greedily from the start.
    ///
    /// # Errors
    /// `post_max` or `post_avg` 0, or a negative `delta`.
    pub fn peaks<T: Real>(&self, x: &[T]) -> Result<Vec<usize>> {
        self.check()?;
        // librosa's compiled code holds delta in single precision whatever the envelope is.
        let delta = f64::from(self.delta as f32);
        let window = |n: usize, before: usize, after: usize| {
            &x[n.saturating_sub(before)..n.saturating_add(after).min(x.len())]
        };
        let mut peaks = Vec::new();
        let mut n = 0;
        while n < x.len() {
            let around = window(n, self.pre_max, self.post_max);
            let highest = around.iter().all(|v| *v <= x[n]);
            if highest {
                let around = window(n, self.pre_avg, self.post_avg);
                let sum = around.iter().fold(T::zero(), |sum, v| sum + *v);
                if x[n].wide() >= sum.wide() / around.len() as f64 + delta {
                    peaks.push(n);
                    n = n.saturating_add(self.wait);
                }
            }
            n = n.saturating_add(1);
        }
        Ok(peaks)
    }
}

/// Scales an envelope to [0, 1]: minus its minimum, over its maximum plus the smallest normal
/// number of `T`.
pub fn normalize_envelope<T: Real>(envelope: &mut [T]) {
    let low = envelope.iter().fold(T::infinity(), |m, x| x.min(m));
    envelope.iter_mut().for_each(|x| *x -= low);
    let high = envelope.iter().fold(T::zero(), |m, x| x.max(m)) + T::min_positive_value();
    envelope.iter_mut().for_each(|x| *x /= high);
}

/// Frames of onsets in an envelope (`onset_detect` on a given envelope), which is normalised to
/// [0, 1] first where asked. A constant or non-finite envelope has none.
///
/// # Errors
/// As [`PeakPick::peaks`].
pub fn onset_detect<T: Real>(
    envelope: &[T],
    normalize: bool,
    pick: &PeakPick,
) -> Result<Vec<usize>> {
    let mut envelope = envelope.to_vec();
    if normalize {
        normalize_envelope(&mut envelope);
    }
    let silent = envelope.iter().all(|x| *x == T::zero());
    if silent || !envelope.iter().all(|x| x.is_finite()) {
        return Ok(Vec::new());
    }
    pick.peaks(&envelope)
}

/// For each event the nearest local minimum of `energy` at or before it, 0 where there is none
/// (`onset_backtrack`).
pub fn backtrack<T: Real>(events: &[usize], energy: &[T]) -> Vec<usize> {
    let minimum = |i: &usize| {
        *i > 0
            && *i + 1 < energy.len()
            && energy[*i] <= energy[*i - 1]
            && energy[*i] < energy[*i + 1]
    };
    events.iter().map(|event| (0..=*event).rev().find(minimum).unwrap_or(0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, array};

    #[test]
    fn a_step_is_an_onset_where_it_happens() {
        let s = Array3::from_shape_fn((1, 4, 10), |(_, k, t)| if t >= 5 { k as f32 } else { 0.0 });
        let params = OnsetParams { center: None, ..OnsetParams::new(2048, 512).unwrap() };
        let envelope = onset_strength(s.view(), None, &params).unwrap();
        assert_eq!(envelope.dim(), (1, 10));
        assert_eq!(envelope[[0, 5]], 1.5);
        assert_eq!(envelope.sum(), 1.5);
        let centred = onset_strength(s.view(), None, &OnsetParams::new(2048, 512).unwrap());
        assert_eq!(centred.unwrap()[[0, 7]], 1.5);
        let rises = onset_rises(s.view(), None, &params).unwrap();
        assert_eq!(rises.slice(s![0, .., 4]), array![0.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn lengths_follow_lag_and_centre() {
        let s = Array3::<f64>::zeros((2, 3, 4));
        for (lag, center, want) in
            [(1, Some(2), 4), (9, Some(2), 4), (9, None, 9), (3, None, 4), (1, Some(7), 4)]
        {
            let params = OnsetParams { lag, max_size: 2, center };
            let envelope = onset_strength(s.view(), None, &params).unwrap();
            assert_eq!(envelope.dim(), (2, want), "{params:?}");
        }
        assert!(
            onset_strength(s.view(), None, &OnsetParams { lag: 0, max_size: 1, center: None })
                .is_err()
        );
    }

    #[test]
    fn maxima_of_odd_and_even_windows() {
        let mut out = [0.0; 5];
        max_filter(&[1.0, 5.0, 2.0, 3.0, 0.0], 3, &mut out);
        assert_eq!(out, [5.0, 5.0, 5.0, 3.0, 3.0]);
        max_filter(&[1.0, 5.0, 2.0, 3.0, 0.0], 2, &mut out);
        assert_eq!(out, [1.0, 5.0, 5.0, 3.0, 3.0]);
        max_filter(&[1.0, 5.0, 2.0, 3.0, 0.0], usize::MAX, &mut out);
        assert_eq!(out, [5.0; 5]);
    }

    #[test]
    fn peaks_are_high_apart_and_above_the_mean() {
        let pick =
            PeakPick { pre_max: 1, post_max: 2, pre_avg: 2, post_avg: 3, delta: 0.2, wait: 1 };
        let x = [0.0_f32, 0.9, 0.1, 1.0, 0.1, 0.15, 0.1, 0.0, 0.8];
        assert_eq!(pick.peaks(&x).unwrap(), [1, 3, 8]);
        assert_eq!(PeakPick { wait: 2, ..pick }.peaks(&x).unwrap(), [1, 8]);
        assert!(PeakPick { post_max: 0, ..pick }.peaks(&x).is_err());
        assert!(PeakPick { delta: -0.1, ..pick }.peaks(&x).is_err());
    }

    #[test]
    fn silence_and_a_single_frame_have_no_onset() {
        let pick = PeakPick::new(22050.0, 512).unwrap();
        assert_eq!(onset_detect(&[0.0_f32; 40], true, &pick).unwrap(), []);
        assert_eq!(onset_detect(&[3.0_f64], true, &pick).unwrap(), []);
        assert_eq!(onset_detect(&[f64::NAN, 1.0], true, &pick).unwrap(), []);
        assert_eq!(onset_detect::<f32>(&[], true, &pick).unwrap(), []);
    }

    #[test]
    fn events_go_back_to_the_minimum_before_them() {
        let energy = [2.0, 1.0, 3.0, 3.0, 2.0, 4.0];
        assert_eq!(backtrack(&[0, 1, 3, 5], &energy), [0, 1, 1, 4]);
    }
}
