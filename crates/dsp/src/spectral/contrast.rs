//! Spectral contrast (librosa 0.11 `feature.spectral_contrast`, after Jiang et al. 2002).

use std::ops::Range;

use ndarray::{Array3, s};

use super::extremes::{AT_ONCE, extremes};
use super::{Frequencies, Spectra};
use crate::decibel::Decibel;
use crate::error::{DspError, Result};
use crate::frequency::require_rate;
use crate::real::Real;
use crate::simd::vectorized;

/// Parameters of the contrast, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContrastParams {
    /// Upper edge in Hz of the lowest band; each further band is an octave.
    pub fmin: f64,
    /// Octave bands above the lowest one: there are `n_bands + 1` rows.
    pub n_bands: usize,
    /// Fraction of a band's bins that make its peak and its valley.
    pub quantile: f64,
    /// Difference of magnitudes instead of decibels.
    pub linear: bool,
}

impl Default for ContrastParams {
    fn default() -> Self {
        Self { fmin: 200.0, n_bands: 6, quantile: 0.02, linear: false }
    }
}

/// The bins of one band and how many of them make a peak or a valley.
#[derive(Debug, Clone)]
struct Band {
    bins: Vec<usize>,
    count: usize,
}

impl Band {
    /// The bins as a range, which they are unless the first wrapped around.
    fn range(&self) -> Option<Range<usize>> {
        let range = *self.bins.first()?..*self.bins.last()? + 1;
        (range.len() == self.bins.len()).then_some(range)
    }
}

impl ContrastParams {
    /// Where a band begins, in Hz.
    pub(crate) fn start_of(&self, band: usize) -> f64 {
        match band {
            0 => 0.0,
            _ => self.fmin * 2.0_f64.powi(band as i32 - 1),
        }
    }
}

/// Tables of the bands for one set of bin frequencies.
#[derive(Debug, Clone)]
pub struct Contrast {
    bands: Vec<Band>,
}

impl Contrast {
    /// Bands over bins at `freqs` Hz. Adjacent bands share their edge bin, bands above the lowest
    /// also take the bin below their edge, and all but the last drop their top bin.
    ///
    /// # Errors
    /// Impossible parameters, a band that starts at or above `sr / 2`, or an octave without bins.
    pub fn new(freqs: &[f64], sr: f64, params: &ContrastParams) -> Result<Self> {
        require_rate(sr)?;
        let n_bands = params.n_bands;
        if n_bands == 0 {
            return Err(DspError::parameter("n_bands", 0, "at least 1"));
        }
        if !(params.quantile > 0.0 && params.quantile < 1.0) {
            return Err(DspError::parameter("quantile", params.quantile, "between 0 and 1"));
        }
        if !(params.fmin.is_finite() && params.fmin > 0.0) {
            return Err(DspError::parameter("fmin", params.fmin, "above 0 Hz"));
        }
        let mut bands = Vec::new();
        for k in 0..=n_bands {
            let (low, high) = (params.start_of(k), params.start_of(k + 1));
            if low >= 0.5 * sr {
                let allowed = format!(
                    "so few that all bands start below sr / 2 (band {k} starts at {low} Hz)"
                );
                return Err(DspError::parameter("n_bands", n_bands, allowed));
            }
            bands.push(Self::band(freqs, low, high, k, params)?);
        }
        Ok(Self { bands })
    }

    fn band(freqs: &[f64], low: f64, high: f64, k: usize, p: &ContrastParams) -> Result<Band> {
        let mut member: Vec<bool> = freqs.iter().map(|f| *f >= low && *f <= high).collect();
        let first = member.iter().position(|m| *m);
        let last = member.iter().rposition(|m| *m);
        if let (Some(first), Some(last)) = (first, last) {
            if k > 0 {
                // librosa's index -1 stands for the last bin.
                member[first.checked_sub(1).unwrap_or(freqs.len() - 1)] = true;
            }
            if k == p.n_bands {
                member[last + 1..].fill(true);
            }
        } else if k > 0 {
            let allowed =
                format!("such that every octave has a bin (none lies in {low} to {high} Hz)");
            return Err(DspError::parameter("fmin", p.fmin, allowed));
        }
        let mut bins: Vec<usize> = (0..freqs.len()).filter(|i| member[*i]).collect();
        // The share is taken before the top bin is dropped; ties round to even.
        let share = (p.quantile * bins.len() as f64).round_ties_even() as usize;
        if k < p.n_bands {
            bins.pop();
        }
        let count = share.clamp(1, bins.len().max(1));
        Ok(Band { bins, count })
    }

    /// Rows of the result, `n_bands + 1`.
    pub fn rows(&self) -> usize {
        self.bands.len()
    }

    /// Whether the lowest band holds no bin; its peaks and valleys are NaN, as librosa's.
    pub fn lowest_is_empty(&self) -> bool {
        self.bands[0].bins.is_empty()
    }

    /// Room that [`peaks_valleys`](Self::peaks_valleys) needs, in values.
    pub fn scratch_len(&self) -> usize {
        2 * self.longest()
    }

    /// Bins of the largest band, rounded up to whole blocks.
    fn longest(&self) -> usize {
        let bins = self.bands.iter().map(|band| band.bins.len());
        bins.max().unwrap_or(0).next_multiple_of(AT_ONCE)
    }

    /// Mean of the largest and of the smallest magnitudes of every band of one spectrum.
    ///
    /// `scratch` has at least [`scratch_len`](Self::scratch_len) values, `peak` and `valley` have
    /// [`rows`](Self::rows).
    pub fn peaks_valleys<T: Real>(
        &self,
        magnitude: &[T],
        scratch: &mut [T],
        peak: &mut [f64],
        valley: &mut [f64],
    ) {
        vectorized(
            #[inline(always)]
            || {
                let (wrapped, scratch) = scratch.split_at_mut(self.longest());
                for ((band, peak), valley) in self.bands.iter().zip(peak).zip(valley) {
                    let values = match band.range() {
                        Some(range) => &magnitude[range],
                        None => {
                            let slots = wrapped.iter_mut().zip(&band.bins);
                            slots.for_each(|(slot, k)| *slot = magnitude[*k]);
                            &wrapped[..band.bins.len()]
                        }
                    };
                    (*valley, *peak) = extremes(values, band.count, scratch);
                }
            },
        );
    }
}

/// Contrast out of raw peaks and valleys of a whole recording, in place in `peaks`.
///
/// In decibels each of the two is clamped to 80 dB below its own maximum over everything given:
/// all channels, bands and frames. That maximum is why a stream can only finish at its end.
///
/// # Errors
/// Slices of different lengths.
pub fn contrast_from_extremes(peaks: &mut [f64], valleys: &mut [f64], linear: bool) -> Result<()> {
    if peaks.len() != valleys.len() {
        let expected = format!("[{}]", peaks.len());
        return Err(DspError::Shape { name: "valleys", expected, actual: vec![valleys.len()] });
    }
    if !linear {
        // The maximum of an array with a NaN is NaN in numpy, and with it every value.
        let spoilt = peaks.iter().chain(valleys.iter()).any(|x| x.is_nan());
        Decibel::default().power(peaks)?;
        Decibel::default().power(valleys)?;
        if spoilt {
            peaks.fill(f64::NAN);
        }
    }
    for (peak, valley) in peaks.iter_mut().zip(valleys) {
        *peak -= *valley;
    }
    Ok(())
}

/// Contrast `[channels, n_bands + 1, frames]` in dB, or in magnitudes where `linear`.
///
/// # Errors
/// As [`Contrast::new`], or frequencies that do not fit.
pub fn spectral_contrast<'a, T: Real>(
    s: impl Into<Spectra<'a, T>>,
    freqs: &[f64],
    sr: f64,
    params: &ContrastParams,
) -> Result<Array3<f64>> {
    let s = s.into();
    Frequencies::Bins(freqs).check(s.dim())?;
    let contrast = Contrast::new(freqs, sr, params)?;
    let rows = contrast.rows();
    let state = || vec![T::zero(); contrast.scratch_len()];
    let extremes = s.map(2 * rows, state, |scratch, _, _, magnitude, out| {
        let (peaks, valleys) = out.split_at_mut(rows);
        contrast.peaks_valleys(magnitude, scratch, peaks, valleys);
    });
    let half = |range| extremes.slice(s![.., range, ..]).as_standard_layout().into_owned();
    let (mut peaks, mut valleys) = (half(0..rows), half(rows..2 * rows));
    if let (Some(peaks), Some(valleys)) = (peaks.as_slice_mut(), valleys.as_slice_mut()) {
        contrast_from_extremes(peaks, valleys, params.linear)?;
    }
    Ok(peaks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frequency::fft_frequencies;

    #[test]
    fn bands_share_edges_and_drop_their_top_bin() {
        let freqs: Vec<f64> = (0..=80).map(|k| 100.0 * f64::from(k)).collect();
        let params = ContrastParams { n_bands: 2, ..ContrastParams::default() };
        let contrast = Contrast::new(&freqs, 16000.0, &params).unwrap();
        let bins = |k: usize| (contrast.bands[k].bins[0], contrast.bands[k].bins.len());
        assert_eq!([bins(0), bins(1), bins(2)], [(0, 2), (1, 3), (3, 78)]);
    }

    #[test]
    fn bands_at_nyquist_and_empty_octaves_are_refused() {
        let refuse = |sr: f64, n_fft: usize| {
            let freqs = fft_frequencies(sr, n_fft).unwrap();
            Contrast::new(&freqs, sr, &ContrastParams::default()).unwrap_err().to_string()
        };
        assert!(refuse(8000.0, 2048).contains("band 6 starts at 6400 Hz"));
        assert!(refuse(44100.0, 32).contains("none lies in 200 to 400 Hz"));
    }

    #[test]
    fn the_clamp_is_joint() {
        let (mut peaks, mut valleys) = ([1.0, 1e-9], [1e-3, 1e-10]);
        contrast_from_extremes(&mut peaks, &mut valleys, false).unwrap();
        assert!((peaks[0] - 30.0).abs() < 1e-9);
        // -80 dB after the clamp instead of -90, minus the valley's unclamped -100.
        assert!((peaks[1] - 20.0).abs() < 1e-9);
    }
}
