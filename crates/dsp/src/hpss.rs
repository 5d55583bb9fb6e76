//! Harmonic-percussive separation by median filtering (librosa 0.11 `decompose.hpss`,
//! `effects.hpss`, after FitzGerald 2010 and Driedger et al. 2014).

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, ArrayViewMut2, s};
use num_complex::Complex;

use crate::error::{DspError, Result};
use crate::librosa::LibrosaVersion;
use crate::median;
use crate::real::{Real, require_finite};
use crate::stft::StftParams;
use crate::transform::{Forward, Inverse};
use crate::vector::Lane;

/// Frames that are separated together: one pass of the median network.
const BLOCK: usize = 16;

/// Parameters of the separation, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HpssParams {
    /// Frames under the median filter along time, which keeps harmonic sound.
    pub kernel_harmonic: usize,
    /// Bins under the median filter along frequency, which keeps percussive sound.
    pub kernel_percussive: usize,
    /// Exponent of the soft masks; infinite for binary masks.
    pub power: f64,
    /// Factor by which the percussive estimate is raised in the harmonic mask.
    pub margin_harmonic: f64,
    /// Factor by which the harmonic estimate is raised in the percussive mask.
    pub margin_percussive: f64,
}

impl Default for HpssParams {
    fn default() -> Self {
        Self {
            kernel_harmonic: 31,
            kernel_percussive: 31,
            power: 2.0,
            margin_harmonic: 1.0,
            margin_percussive: 1.0,
        }
    }
}

/// Longest median filter; beyond it the window alone would fill memory.
const LONGEST_KERNEL: usize = 1 << 20;

impl HpssParams {
    /// Refuses kernels of no or too many values, margins below 1 and powers that are not positive.
    pub fn check(&self) -> Result<()> {
        for kernel in [self.kernel_harmonic, self.kernel_percussive] {
            if !(1..=LONGEST_KERNEL).contains(&kernel) {
                let allowed = format!("1 to {LONGEST_KERNEL}");
                return Err(DspError::parameter("kernel_size", kernel, allowed));
            }
        }
        for margin in [self.margin_harmonic, self.margin_percussive] {
            if margin.is_nan() || margin < 1.0 {
                return Err(DspError::parameter("margin", margin, "at least 1"));
            }
        }
        if self.power.is_nan() || self.power <= 0.0 {
            return Err(DspError::parameter("power", self.power, "above 0"));
        }
        Ok(())
    }

    /// Mask value where both estimates vanish.
    fn at_silence<T: Real>(&self) -> T {
        let margins = [self.margin_harmonic, self.margin_percussive];
        T::of(if margins == [1.0, 1.0] { 0.5 } else { 0.0 })
    }

    /// The mask of `part` from the median-filtered magnitudes of both, into `mask`.
    fn mask<T: Real>(&self, part: Part, harmonic: &[T], percussive: &[T], mask: &mut [T]) {
        let (x, reference, margin) = match part {
            Part::Harmonic => (harmonic, percussive, self.margin_harmonic),
            Part::Percussive => (percussive, harmonic, self.margin_percussive),
        };
        let (margin, silence, power) = (T::of(margin), self.at_silence(), T::of(self.power));
        let values = mask.iter_mut().zip(x.iter().zip(reference));
        let values = values.map(|(mask, (x, reference))| (mask, *x, *reference * margin));
        if self.power == 2.0 {
            crate::simd::vectorized(
                #[inline(always)]
                || {
                    values.for_each(|(mask, x, reference)| {
                        *mask = soft_mask(x, reference, silence, |x| x * x);
                    });
                },
            );
        } else if self.power.is_infinite() {
            values.for_each(|(mask, x, reference)| {
                *mask = if x > reference { T::one() } else { T::zero() };
            });
        } else {
            values.for_each(|(mask, x, reference)| {
                *mask = soft_mask(x, reference, silence, |x| x.powf(power));
            });
        }
    }
}

/// `x^p / (x^p + reference^p)`, scaled against overflow (librosa 0.11 `util.softmask`).
#[inline(always)]
fn soft_mask<T: Real>(x: T, reference: T, silence: T, power: impl Fn(T) -> T) -> T {
    let larger = if x > reference { x } else { reference };
    let vanish = larger < T::min_positive_value();
    let scale = if vanish { T::one() } else { larger };
    let (x, reference) = (power(x / scale), power(reference / scale));
    if vanish { silence } else { x / (x + reference) }
}

/// Harmonic and percussive masks, shaped as the magnitudes `s [channels, bins, frames]`. Channels
/// are independent.
///
/// # Errors
/// Impossible parameters, or magnitudes that are negative or not finite.
pub fn masks<T: Lane>(s: ArrayView3<T>, p: &HpssParams) -> Result<(Array3<T>, Array3<T>)> {
    p.check()?;
    let s = s.as_standard_layout();
    require_finite("S", s.iter())?;
    let (mut harmonic, mut percussive) = (Array3::zeros(s.dim()), Array3::zeros(s.dim()));
    let (_, bins, frames) = s.dim();
    let mut mask = vec![T::zero(); bins * frames];
    for ((s, mut h), mut q) in
        s.outer_iter().zip(harmonic.outer_iter_mut()).zip(percussive.outer_iter_mut())
    {
        median::across(s, p.kernel_harmonic, h.view_mut());
        median::down(s, p.kernel_percussive, 0..bins, q.view_mut());
        if h.iter().chain(q.iter()).any(|m| *m < T::zero()) {
            return Err(DspError::parameter("S", "negative", "magnitudes, 0 or more"));
        }
        let (h, q) =
            (h.as_slice_mut().expect("a new array"), q.as_slice_mut().expect("a new array"));
        p.mask(Part::Harmonic, h, q, &mut mask);
        let filtered = h.to_vec();
        h.copy_from_slice(&mask);
        p.mask(Part::Percussive, &filtered, q, &mut mask);
        q.copy_from_slice(&mask);
    }
    Ok((harmonic, percussive))
}

/// A component of the separation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// What is steady along time.
    Harmonic,
    /// What is spread over frequency.
    Percussive,
}

/// Working memory of a separation, which later ones may use again.
#[derive(Default)]
pub struct Work<T> {
    /// Magnitudes of all frames, `[frames][bins]`.
    magnitude: Vec<T>,
    /// Spectra of the frames under the filter along time.
    waiting: Vec<Complex<T>>,
    harmonic: Vec<T>,
    percussive: Vec<T>,
    mask: Vec<T>,
}

impl<T: Real> Work<T> {
    /// Magnitude spectra of the recording last separated, `[frames][bins]`.
    pub fn magnitude(&self) -> &[T] {
        &self.magnitude
    }
}

/// Separates recordings; made once for all of them.
#[derive(Clone)]
pub struct Separator<T: Real> {
    forward: Forward<f64>,
    inverse: Inverse<T>,
    params: HpssParams,
    /// Invert the masks instead of the masked spectrum.
    mask: bool,
}

impl<T: Lane> Separator<T> {
    /// `mask = true` inverts the masks alone, as librosa's `mask` argument does.
    ///
    /// # Errors
    /// Impossible parameters.
    pub fn new(stft: &StftParams, params: HpssParams, mask: bool) -> Result<Self> {
        params.check()?;
        Ok(Self { forward: Forward::new(stft)?, inverse: Inverse::new(stft)?, params, mask })
    }

    /// Writes `parts` of `y` to as many buffers of its length, calls `observe` with each magnitude
    /// spectrum in turn, and leaves them all in `work`.
    ///
    /// The complex spectra are kept for the frames under the median filter only.
    ///
    /// # Errors
    /// A signal too short for one frame.
    ///
    /// # Panics
    /// When a buffer has another length.
    pub fn separate(
        &self,
        y: &[T],
        parts: &mut [(Part, &mut [T])],
        work: &mut Work<T>,
        mut observe: impl FnMut(&[T]),
    ) -> Result<()> {
        let stft = self.forward.params();
        let (frames, bins) = (stft.n_frames(y.len()), stft.n_bins());
        if frames == 0 {
            let needed = if stft.center { 1 } else { stft.n_fft };
            return Err(DspError::TooShort { name: "y", actual: y.len(), needed });
        }
        let inverted = stft.frames_within(y.len(), frames);
        for (_, out) in &mut *parts {
            assert_eq!(out.len(), y.len(), "one output sample per input sample");
            out.fill(T::zero());
        }
        // Spectra wait for the frames that the filter along time looks ahead.
        let kept = (BLOCK + self.params.kernel_harmonic).min(frames).next_multiple_of(BLOCK);
        let Work { magnitude, waiting, harmonic, percussive, mask } = work;
        magnitude.resize(frames * bins, T::zero());
        waiting.resize(kept * bins, Complex::default());
        for block in [&mut *harmonic, &mut *percussive, &mut *mask] {
            block.resize(BLOCK * bins, T::zero());
        }
        let (mut scratch, mut inverse) = (self.forward.scratch(), self.inverse.scratch());
        let mut analysed = 0;
        for first in (0..frames).step_by(BLOCK) {
            let end = frames.min(first + BLOCK);
            while analysed < frames.min(end + self.params.kernel_harmonic / 2) {
                let spectrum = self.forward.spectrum(y, analysed, &mut scratch);
                let row = &mut magnitude[analysed * bins..(analysed + 1) * bins];
                round(spectrum, &mut waiting[analysed % kept * bins..][..bins], row);
                observe(row);
                analysed += 1;
            }
            let n = end - first;
            let (h, q) = (&mut harmonic[..n * bins], &mut percussive[..n * bins]);
            let whole = ArrayView2::from_shape((frames, bins), &*magnitude).expect("every frame");
            let rows = |values| ArrayViewMut2::from_shape((n, bins), values).expect("n frames");
            median::down(whole, self.params.kernel_harmonic, first..end, rows(&mut *h));
            let frames = whole.slice(s![first..end, ..]);
            median::across(frames, self.params.kernel_percussive, rows(&mut *q));
            for (part, out) in &mut *parts {
                let mask = &mut mask[..n * bins];
                self.params.mask(*part, h, q, mask);
                for (t, mask) in (first..end.min(inverted)).zip(mask.chunks_exact(bins)) {
                    if self.mask {
                        let values = inverse.bins().iter_mut().zip(mask);
                        values.for_each(|(z, m)| *z = Complex::new(*m, T::zero()));
                    } else {
                        let spectrum = &waiting[t % kept * bins..][..bins];
                        masked(spectrum, mask, inverse.bins());
                    }
                    self.inverse.add(t, out, &mut inverse);
                }
            }
        }
        for (_, out) in parts {
            self.inverse.normalize(inverted, out);
        }
        Ok(())
    }
}

/// Rounds a spectrum to `T`, as librosa stores it, and takes the magnitudes of the rounded values.
fn round<T: Real>(spectrum: &[Complex<f64>], rounded: &mut [Complex<T>], magnitude: &mut [T]) {
    crate::simd::vectorized(
        #[inline(always)]
        || {
            for ((z, rounded), m) in spectrum.iter().zip(rounded).zip(magnitude) {
                *rounded = Complex::new(T::of(z.re), T::of(z.im));
                let (re, im) = (rounded.re.wide(), rounded.im.wide());
                *m = T::of((re * re + im * im).sqrt());
            }
        },
    );
}

/// `spectrum * mask`.
fn masked<T: Real>(spectrum: &[Complex<T>], mask: &[T], out: &mut [Complex<T>]) {
    crate::simd::vectorized(
        #[inline(always)]
        || {
            for ((out, z), m) in out.iter_mut().zip(spectrum).zip(mask) {
                *out = Complex::new(z.re * *m, z.im * *m);
            }
        },
    );
}

/// Takes the harmonic part of recordings (`effects.harmonic` with its defaults) by the conventions of
/// a librosa.
pub struct HarmonicPart {
    separator: Separator<f32>,
    librosa: LibrosaVersion,
}

impl HarmonicPart {
    /// # Errors
    /// None that the defaults allow.
    pub fn new(librosa: LibrosaVersion) -> Result<Self> {
        let stft = StftParams { pad_mode: librosa.pad_mode(), ..StftParams::new(2048, 512) };
        Ok(Self { separator: Separator::new(&stft, HpssParams::default(), false)?, librosa })
    }

    /// Writes the part of `y` to `part`, as long as it. Magnitude spectra are shown to `observe` one
    /// after the other, and stay in `work`.
    ///
    /// # Errors
    /// No samples.
    pub fn of(
        &self,
        y: &[f32],
        part: &mut Vec<f32>,
        work: &mut Work<f32>,
        observe: impl FnMut(&[f32]),
    ) -> Result<()> {
        part.resize(y.len(), 0.0);
        let parts = &mut [(Part::Harmonic, part.as_mut_slice())];
        self.separator.separate(y, parts, work, observe)?;
        if self.librosa == LibrosaVersion::V08 {
            // It inverted without a length and filled up with zeros after the last frame's centre.
            let stft = self.separator.forward.params();
            part[stft.hop_length * (stft.n_frames(y.len()) - 1)..].fill(0.0);
        }
        Ok(())
    }
}

/// The asked parts of `y [channels, samples]`, each of its shape (librosa 0.11 `effects.hpss`,
/// `effects.harmonic`, `effects.percussive`). Channels are independent.
///
/// # Errors
/// Impossible parameters, a signal too short for one frame, or samples that are not finite.
pub fn separate<T: Lane>(
    y: ArrayView2<T>,
    stft: &StftParams,
    params: &HpssParams,
    mask: bool,
    parts: &[Part],
) -> Result<Vec<Array2<T>>> {
    let separator = Separator::new(stft, *params, mask)?;
    require_finite("y", y.iter())?;
    let y = y.as_standard_layout();
    let mut separated = vec![Array2::zeros(y.dim()); parts.len()];
    let mut work = Work::default();
    for (c, y) in y.rows().into_iter().enumerate() {
        let y = y.to_slice().expect("standard layout");
        let mut rows: Vec<_> = separated.iter_mut().map(|part| part.row_mut(c)).collect();
        let outputs = rows.iter_mut().map(|row| row.as_slice_mut().expect("a new array"));
        let mut parts: Vec<_> = parts.iter().copied().zip(outputs).collect();
        separator.separate(y, &mut parts, &mut work, |_| {})?;
    }
    Ok(separated)
}
