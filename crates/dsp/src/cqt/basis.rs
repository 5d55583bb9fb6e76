//! Wavelet filters of the constant-Q transform in the frequency domain.

use num_complex::Complex;
use rustfft::FftPlanner;

use super::CqtParams;
use crate::error::{DspError, Result};
use crate::window::{Window, get_window};

/// Longest filter in samples, against parameters that no memory could hold.
const LONGEST_FILTER: f64 = (1 << 22) as f64;

/// The filters of a transform, lowest frequency first.
#[derive(Debug, Clone)]
pub(super) struct Wavelets {
    /// Centre frequencies in Hz, tuning applied.
    pub frequencies: Vec<f64>,
    /// Quality factors: centre frequency over bandwidth.
    pub q: Vec<f64>,
}

impl Wavelets {
    /// Equal temperament from `fmin` on (librosa 0.11 `interval_frequencies`,
    /// `filters._relative_bandwidth`).
    pub fn new(p: &CqtParams) -> Self {
        let fmin = p.fmin * 2.0_f64.powf(p.tuning / p.bins_per_octave as f64);
        let frequencies: Vec<f64> = (0..p.n_bins)
            .map(|k| {
                let step = (k % p.bins_per_octave) as f64 / p.bins_per_octave as f64;
                2.0_f64.powi((k / p.bins_per_octave) as i32) * 2.0_f64.powf(step) * fmin
            })
            .collect();
        let octaves: Vec<f64> = frequencies.iter().map(|f| f.log2()).collect();
        let last = p.n_bins - 1;
        let q = (0..p.n_bins)
            .map(|k| {
                // Local bins per octave: exact up to rounding, which librosa's values contain too.
                let density = if last == 0 {
                    p.bins_per_octave as f64
                } else if k == 0 || k == last {
                    let low = k.saturating_sub(1);
                    1.0 / (octaves[low + 1] - octaves[low])
                } else {
                    2.0 / (octaves[k + 1] - octaves[k - 1])
                };
                let ratio = 2.0_f64.powf(2.0 / density);
                p.filter_scale * (ratio + 1.0) / (ratio - 1.0)
            })
            .collect();
        Self { frequencies, q }
    }

    /// Length in samples of filter `k` at the sample rate `sr`; a fraction counts.
    pub fn length(&self, k: usize, sr: f64) -> f64 {
        self.q[k] * sr / self.frequencies[k]
    }

    /// Frequency in Hz up to which the filters reach (to half their height).
    ///
    /// # Errors
    /// A window that has no such length.
    pub fn cutoff(&self, window: &Window) -> Result<f64> {
        let bandwidth = noise_bandwidth(window)?;
        let reach = |(f, q): (&f64, &f64)| f * (1.0 + 0.5 * bandwidth / q);
        Ok(self.frequencies.iter().zip(&self.q).map(reach).fold(0.0, f64::max))
    }
}

/// Equivalent noise bandwidth in bins, on the symmetric 8193-point window that librosa's table was
/// made with. That table's entry for the flat top is not its bandwidth; windows that are not in it
/// are measured on 1000 periodic points.
fn noise_bandwidth(window: &Window) -> Result<f64> {
    let (n, periodic) = match window {
        Window::FlatTop => return Ok(2.776_225_504_648_414),
        Window::Hann
        | Window::Hamming
        | Window::Blackman
        | Window::BlackmanHarris
        | Window::Nuttall
        | Window::Bartlett
        | Window::Triang
        | Window::Cosine
        | Window::Boxcar
        | Window::Parzen
        | Window::Bohman
        | Window::BartHann => (8193, false),
        _ => (1000, true),
    };
    let values = get_window(window, n, periodic)?;
    let sum: f64 = values.iter().sum();
    Ok(n as f64 * values.iter().map(|w| w * w).sum::<f64>() / (sum * sum))
}

/// Filters of one octave: for each bin the weights of consecutive spectrum bins.
#[derive(Debug, Clone)]
pub(super) struct Basis {
    /// Length of the transform that the weights belong to, a power of two.
    pub n_fft: usize,
    /// First spectrum bin and weights of each filter.
    pub rows: Vec<(usize, Vec<Complex<f32>>)>,
}

impl Basis {
    /// Length of the transform for the filters `range` of `wavelets` at the sample rate `sr`.
    ///
    /// # Errors
    /// Filters of less than one or of too many samples.
    pub fn transform_length(
        wavelets: &Wavelets,
        range: std::ops::Range<usize>,
        sr: f64,
        p: &CqtParams,
    ) -> Result<usize> {
        let longest = range.map(|k| wavelets.length(k, sr)).fold(0.0, f64::max);
        if !(0.5..=LONGEST_FILTER).contains(&longest) {
            let allowed = format!(
                "such that the longest filter has 1 to {LONGEST_FILTER} samples (it has {longest:.3})"
            );
            return Err(DspError::parameter("filter_scale", p.filter_scale, allowed));
        }
        Ok(2.0_f64.powf(longest.log2().ceil()) as usize)
    }

    /// The filters `range` of `wavelets` at the sample rate `sr`, transformed to `n_fft` values and
    /// without the smallest of them (librosa 0.11 `__vqt_filter_fft`, `util.sparsify_rows`).
    ///
    /// # Errors
    /// A window that has no such length.
    pub fn new(
        wavelets: &Wavelets,
        range: std::ops::Range<usize>,
        sr: f64,
        n_fft: usize,
        p: &CqtParams,
    ) -> Result<Self> {
        let fft = FftPlanner::<f64>::new().plan_fft_forward(n_fft);
        let mut scratch = vec![Complex::default(); fft.get_inplace_scratch_len()];
        let rows = range.map(|k| {
            let length = wavelets.length(k, sr);
            let mut filter = wavelet(wavelets.frequencies[k] / sr, length, n_fft, p)?;
            fft.process_with_scratch(&mut filter, &mut scratch);
            filter.truncate(n_fft / 2 + 1);
            Ok(sparse(&filter, p.sparsity))
        });
        Ok(Self { n_fft, rows: rows.collect::<Result<_>>()? })
    }

    /// Numbers that one frame touches: its transform and the weights of all filters.
    pub fn work(&self) -> usize {
        self.n_fft + self.rows.iter().map(|(_, weights)| weights.len()).sum::<usize>()
    }
}

/// The windowed complex tone of `length` samples at `frequency` (in cycles per sample), centred in
/// `n_fft` samples and scaled by `length / n_fft`. Rounded to single precision, as librosa's is.
fn wavelet(frequency: f64, length: f64, n_fft: usize, p: &CqtParams) -> Result<Vec<Complex<f64>>> {
    let start = (-length / 2.0).floor();
    let n = ((length / 2.0).floor() - start) as usize;
    let window = get_window(&p.window, n, true)?;
    let mut tone: Vec<Complex<f64>> = (0..n)
        .map(|i| {
            let angle = (start + i as f64) * 2.0 * std::f64::consts::PI * frequency;
            Complex::from_polar(1.0, angle) * window[i]
        })
        .collect();
    if let Some(norm) = p.norm {
        let magnitude: Vec<f64> = tone.iter().map(|z| z.norm()).collect();
        let divisor = norm.divisor(&magnitude);
        tone.iter_mut().for_each(|z| *z /= divisor);
    }
    let single = |x: f64| f64::from(x as f32);
    let scale = length / n_fft as f64;
    let mut padded = vec![Complex::default(); n_fft];
    let left = (n_fft - n) / 2;
    for (slot, z) in padded[left..].iter_mut().zip(tone) {
        *slot = Complex::new(single(single(z.re) * scale), single(single(z.im) * scale));
    }
    Ok(padded)
}

/// The values without the smallest magnitudes that together make up `quantile` of the sum of all:
/// the first that is kept, and all to the last.
fn sparse(values: &[Complex<f64>], quantile: f64) -> (usize, Vec<Complex<f32>>) {
    let magnitude: Vec<f64> = values.iter().map(|z| z.norm()).collect();
    let total: f64 = magnitude.iter().sum();
    let mut sorted = magnitude.clone();
    sorted.sort_by(f64::total_cmp);
    let mut sum = 0.0;
    let threshold = sorted.iter().find(|m| {
        sum += **m / total;
        sum >= quantile
    });
    let threshold = threshold.or(sorted.first()).copied().unwrap_or(0.0);
    let keep = |m: &f64| *m >= threshold;
    let first = magnitude.iter().position(keep).unwrap_or(0);
    let end = magnitude.iter().rposition(keep).map_or(first, |last| last + 1);
    let weights = (first..end).map(|k| {
        let z = if keep(&magnitude[k]) { values[k] } else { Complex::default() };
        Complex::new(z.re as f32, z.im as f32)
    });
    (first, weights.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_bandwidths_are_those_of_the_table() {
        let close = |w, want: f64| (noise_bandwidth(&w).unwrap() - want).abs() < 1e-9;
        assert!(close(Window::Hann, 1.50018310546875));
        assert!(close(Window::Hamming, 1.3629455320350348));
        assert!(close(Window::Boxcar, 1.0));
        assert!(close(Window::Parzen, 1.917_460_317_460_319));
        assert!(close(Window::Bohman, 1.785_958_861_386_006_2));
        assert!(close(Window::BartHann, 1.456_025_596_513_393_2));
    }

    #[test]
    fn sparse_rows_keep_what_matters() {
        let values: Vec<_> =
            [0.001, 0.002, 0.5, 0.003, 0.494].iter().map(|m| Complex::new(0.0, *m)).collect();
        let (first, weights) = sparse(&values, 0.01);
        let kept: Vec<f32> = weights.iter().map(|z| z.im).collect();
        assert_eq!((first, kept), (2, vec![0.5, 0.0, 0.494]));
        assert_eq!(sparse(&values, 0.0).1.len(), 5);
    }

    #[test]
    fn octaves_double() {
        let p = CqtParams { n_bins: 25, tuning: 0.3, ..CqtParams::new(22050.0) };
        let w = Wavelets::new(&p);
        assert_eq!(w.frequencies[24], 4.0 * w.frequencies[0]);
        assert!((w.q[0] - w.q[13]).abs() < 1e-9);
    }
}
