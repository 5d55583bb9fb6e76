//! Constant-Q transform by octaves (librosa 0.11 `cqt`, after Schoerkhuber and Klapuri 2010).
//!
//! Each octave is a short transform times a sparse filter bank; between octaves the signal is
//! decimated by two, so that the same filter lengths serve all of them.

mod basis;
mod chroma;
mod decimate;
mod octaves;
mod params;
mod tuning;

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, Array3, ArrayView2, Axis};
use num_complex::Complex;
use rayon::prelude::*;

pub use chroma::{ChromaCqt, ChromaCqtParams, chroma_cqt, cq_to_chroma};
pub use params::{C1, CqtParams};
pub use tuning::SignalTuning;

use crate::error::{DspError, Result};
use crate::lanes::{LANES, LaneFft, Row, Slots, gather};
use crate::real::require_finite;
use crate::resample::{ResType, resample};
use crate::stft::StftParams;
use crate::transform::Forward;
use crate::vector::Lane;
use crate::window::Window;
use basis::{Basis, Wavelets};
use decimate::Decimator;
use octaves::{Layout, early_halvings, layouts, pass_band, require_work};

/// One octave of filters and how its signal comes about.
struct Octave {
    basis: Arc<Basis>,
    /// Lane transform, where there is one for this length.
    lanes: Option<Arc<LaneFft>>,
    /// First of its bins in the result.
    first: usize,
    /// Factor on its result, per bin.
    gains: Vec<f32>,
    hop: usize,
    /// Whether the next octave works at half the rate.
    halve: bool,
}

impl Octave {
    /// Its bins in the result.
    fn bins(&self) -> Range<usize> {
        self.first..self.first + self.basis.rows.len()
    }
}

/// Filters and transforms for one set of parameters, shared between recordings and threads.
pub struct CqtPlan {
    params: CqtParams,
    /// Halvings of the rate before the first octave.
    early: u32,
    /// These halvings but the last, and the last of them.
    early_decimators: [Decimator; 2],
    /// Halving between octaves.
    decimator: Decimator,
    /// Octaves from the highest down.
    octaves: Vec<Octave>,
}

impl CqtPlan {
    /// # Errors
    /// Impossible parameters, filters that reach above half the sample rate, or more of them or of
    /// frames than can be computed in sensible time.
    pub fn new(p: &CqtParams) -> Result<Self> {
        p.check()?;
        let wavelets = Wavelets::new(p);
        let (cutoff, nyquist) = (wavelets.cutoff(&p.window)?, p.sr / 2.0);
        if !(cutoff <= nyquist && wavelets.frequencies[0] > 0.0) {
            let allowed = format!(
                "so few that all filters end below sr / 2 = {nyquist} Hz (the highest reaches {cutoff:.1} Hz)"
            );
            return Err(DspError::parameter("n_bins", p.n_bins, allowed));
        }
        let n_octaves = p.n_bins.div_ceil(p.bins_per_octave);
        let early =
            early_halvings(pass_band(p.res_type) * nyquist, cutoff, p.hop_length, n_octaves);
        let base = p.sr / f64::from(1u32 << early);
        let mut octaves: Vec<Octave> = Vec::with_capacity(n_octaves);
        let mut work = 0.0;
        for layout in layouts(p, &wavelets, (base, p.hop_length >> early))? {
            let Layout { bins, sr, hop, halve, n_fft, as_above } = layout;
            let (basis, lanes) = match octaves.last() {
                Some(above) if as_above => (above.basis.clone(), above.lanes.clone()),
                _ => {
                    let basis = Basis::new(&wavelets, bins.clone(), sr, n_fft, p)?;
                    let lanes = LaneFft::<Row>::supports(n_fft)
                        .then(|| LaneFft::new(n_fft).map(Arc::new))
                        .transpose()?;
                    (Arc::new(basis), lanes)
                }
            };
            work += basis.work() as f64 * (sr / p.sr / hop as f64);
            require_work(work, p)?;
            let gain = |k: usize| {
                let scale = if p.scale { wavelets.length(k, base).sqrt() } else { 1.0 };
                // Without the scale, early halving is made up for.
                let early = if p.scale { 1.0 } else { f64::from(1u32 << early).sqrt() };
                (early * (base / sr).sqrt() / scale) as f32
            };
            let gains = bins.clone().map(gain).collect();
            octaves.push(Octave { basis, lanes, first: bins.start, gains, hop, halve });
        }
        let early_decimators = [Decimator::early(early), Decimator::last(early.max(1))];
        let decimator = match p.res_type {
            ResType::SoxrHq => Decimator::last(1),
            ResType::KaiserBest => Decimator::windowed_sinc(false),
            ResType::KaiserFast => Decimator::windowed_sinc(true),
        };
        Ok(Self { params: p.clone(), early, early_decimators, decimator, octaves })
    }

    /// The parameters of the transform.
    pub fn params(&self) -> &CqtParams {
        &self.params
    }

    /// Transform `[n_bins, frames]` of one channel.
    ///
    /// # Errors
    /// A signal shorter than the early decimation needs, or without samples.
    pub fn transform<T: Lane>(&self, y: &[T]) -> Result<Array2<Complex<T>>> {
        let mut out = Array2::zeros((self.params.n_bins, self.n_frames(y.len())));
        self.respond_to(y, |bin, frame, re, im| {
            let mut row = out.row_mut(bin);
            let row = row.as_slice_mut().expect("a new array");
            for ((z, re), im) in row[frame..].iter_mut().zip(re).zip(im) {
                *z = Complex::new(*re, *im);
            }
        })?;
        Ok(out)
    }

    /// Frames of the transform of `n` samples.
    pub fn n_frames(&self, n: usize) -> usize {
        let mut length = n.div_ceil(1 << self.early);
        let mut frames = usize::MAX;
        for octave in &self.octaves {
            frames = frames.min(1 + length / octave.hop);
            if octave.halve {
                length = length.div_ceil(2);
            }
        }
        frames
    }

    /// Calls `each(bin, frame, re, im)` with the responses of every bin to a run of frames from
    /// `frame` on; bins of an octave come in order, octaves from the highest down.
    ///
    /// # Errors
    /// As [`transform`](Self::transform).
    fn respond_to<T: Lane>(
        &self,
        y: &[T],
        mut each: impl FnMut(usize, usize, &[T], &[T]),
    ) -> Result<()> {
        let frames = self.n_frames(y.len());
        let signals = self.signals(y, false)?;
        for (i, octave) in self.octaves.iter().enumerate() {
            self.octave(octave, of_octave(&signals, i), frames, &mut each)?;
        }
        Ok(())
    }

    /// As [`transform`](Self::transform), octaves on all threads of the pool.
    fn transform_at_once<T: Lane>(&self, y: &[T]) -> Result<Array2<Complex<T>>> {
        let frames = self.n_frames(y.len());
        let signals = self.signals(y, true)?;
        let mut out = Array2::zeros((self.params.n_bins, frames));
        let mut rest = out.as_slice_mut().expect("a new array");
        let mut parts = Vec::with_capacity(self.octaves.len());
        for (i, octave) in self.octaves.iter().enumerate() {
            let signal = of_octave(&signals, i);
            let (lower, rows) = rest.split_at_mut(octave.first * frames);
            parts.push((octave, signal, rows));
            rest = lower;
        }
        parts.into_par_iter().try_for_each(|(octave, signal, rows)| {
            self.octave(octave, signal, frames, &mut |bin, frame, re: &[T], im: &[T]| {
                let row = &mut rows[(bin - octave.first) * frames + frame..];
                for ((z, re), im) in row.iter_mut().zip(re).zip(im) {
                    *z = Complex::new(*re, *im);
                }
            })
        })?;
        Ok(out)
    }

    /// The signals of the octaves, from the highest down; those below the last have its signal, as an odd
    /// hop is not halved.
    fn signals<'y, T: Lane>(&self, y: &'y [T], at_once: bool) -> Result<Vec<Cow<'y, [T]>>> {
        let factor = 1usize << self.early;
        if y.is_empty() || y.len() < factor {
            return Err(DspError::TooShort { name: "y", actual: y.len(), needed: factor });
        }
        let first = match self.early {
            0 => Cow::Borrowed(y),
            _ => Cow::Owned(self.decimated_early(y, at_once)?),
        };
        let mut signals = vec![first];
        let above = self.octaves.split_last().map_or(&[][..], |(_, above)| above);
        for _ in above.iter().take_while(|octave| octave.halve) {
            let next = self.halved(&signals[signals.len() - 1], at_once);
            signals.push(Cow::Owned(next));
        }
        Ok(signals)
    }

    /// Calls `each` as [`respond_to`](Self::respond_to) does, for one octave of this signal.
    fn octave<T: Lane>(
        &self,
        octave: &Octave,
        signal: &[T],
        frames: usize,
        each: &mut impl FnMut(usize, usize, &[T], &[T]),
    ) -> Result<()> {
        match T::as_f32(signal).zip(octave.lanes.as_deref()) {
            Some((signal, fft)) => self.respond_in_lanes(octave, fft, signal, frames, each),
            None => self.respond(octave, signal, frames, each)?,
        }
        Ok(())
    }

    /// The signal of the first octave, where it has a lower rate.
    fn decimated_early<T: Lane>(&self, y: &[T], at_once: bool) -> Result<Vec<T>> {
        let factor = 1usize << self.early;
        if self.params.res_type != ResType::SoxrHq {
            let y = ArrayView2::from_shape((1, y.len()), y).expect("one row");
            let res_type = self.params.res_type;
            let signal = resample(y, factor as f64, 1.0, res_type, true, true)?;
            return Ok(signal.into_raw_vec_and_offset().0);
        }
        // soxr rounds the number of samples half up, librosa pads to the next larger with a zero.
        let n = (y.len() + factor / 2) / factor;
        let mut signal = Cow::Borrowed(y);
        let [early, last] = &self.early_decimators;
        for level in 1..self.early {
            // The response after the end counts in the later stages.
            let after = n << (self.early - level);
            signal = Cow::Owned(early.halve(&signal, after + last.reach(), at_once));
        }
        let mut signal = last.halve(&signal, n, at_once);
        signal.resize(y.len().div_ceil(factor), T::zero());
        Ok(signal)
    }

    /// The signal of the next octave.
    fn halved<T: Lane>(&self, signal: &[T], at_once: bool) -> Vec<T> {
        let n = signal.len().div_ceil(2);
        // resampy gives whole samples only, librosa pads to the next larger with a zero.
        let filtered = if self.params.res_type == ResType::SoxrHq { n } else { signal.len() / 2 };
        let mut halved = self.decimator.halve(signal, filtered, at_once);
        halved.resize(n, T::zero());
        halved
    }

    fn stft(&self, octave: &Octave) -> StftParams {
        StftParams {
            window: Window::Boxcar,
            pad_mode: self.params.pad_mode,
            ..StftParams::new(octave.basis.n_fft, octave.hop)
        }
    }

    /// Filter responses of one octave, frame by frame.
    fn respond<T: Lane>(
        &self,
        octave: &Octave,
        signal: &[T],
        frames: usize,
        each: &mut impl FnMut(usize, usize, &[T], &[T]),
    ) -> Result<()> {
        let forward = Forward::<T>::new(&self.stft(octave))?;
        let mut scratch = forward.scratch();
        for t in 0..frames {
            let spectrum = forward.spectrum(signal, t, &mut scratch);
            let filters = octave.basis.rows.iter().zip(&octave.gains);
            for (bin, ((first, weights), gain)) in (octave.first..).zip(filters) {
                let mut sum = Complex::<T>::default();
                for (w, x) in weights.iter().zip(&spectrum[*first..]) {
                    sum += x * Complex::new(T::of(w.re.into()), T::of(w.im.into()));
                }
                let sum = sum.scale(T::of(f64::from(*gain)));
                each(bin, t, &[sum.re], &[sum.im]);
            }
        }
        Ok(())
    }

    /// As [`respond`](Self::respond), sixteen frames at a time.
    fn respond_in_lanes<T: Lane>(
        &self,
        octave: &Octave,
        fft: &LaneFft,
        signal: &[f32],
        frames: usize,
        each: &mut impl FnMut(usize, usize, &[T], &[T]),
    ) {
        let n_fft = octave.basis.n_fft;
        let padded = self.params.pad_mode.extended(signal, n_fft / 2);
        let window = vec![1.0; n_fft];
        let mut samples = vec![Row::ZERO; n_fft];
        let mut spectrum = vec![Row::ZERO; 2 * fft.n_bins()];
        let mut response = vec![[Row::ZERO; 2]; octave.basis.rows.len()];
        for slots in Slots::blocks(frames, 1) {
            gather(&padded, octave.hop, &window, slots, &mut samples);
            fft.complex(&mut samples, &mut spectrum);
            project(&octave.basis, &octave.gains, &spectrum, &mut response);
            for (bin, [re, im]) in (octave.first..).zip(&response) {
                let [re, im] = [re, im].map(|row| row.0.map(|x| T::of(x.into())));
                each(bin, slots.first, &re[..slots.len], &im[..slots.len]);
            }
        }
    }
}

/// Products of every filter with sixteen spectra (real and imaginary rows alternating).
fn project(basis: &Basis, gains: &[f32], spectrum: &[Row], response: &mut [[Row; 2]]) {
    let bins = spectrum.as_chunks::<2>().0;
    crate::simd::vectorized(
        #[inline(always)]
        || {
            let filters = basis.rows.iter().zip(gains);
            for (((first, weights), gain), response) in filters.zip(response) {
                let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
                for (w, x) in weights.iter().zip(&bins[*first..]) {
                    for l in 0..LANES {
                        re[l] += w.re * x[0].0[l] - w.im * x[1].0[l];
                        im[l] += w.re * x[1].0[l] + w.im * x[0].0[l];
                    }
                }
                let [re_out, im_out] = response;
                for l in 0..LANES {
                    re_out.0[l] = re[l] * gain;
                    im_out.0[l] = im[l] * gain;
                }
            }
        },
    );
}

/// Constant-Q transform `[channels, n_bins, frames]` of `y [channels, samples]`. Channels are
/// independent.
///
/// # Errors
/// As [`CqtPlan::new`] and [`CqtPlan::transform`], or samples that are not finite.
pub fn cqt<T: Lane>(y: ArrayView2<T>, p: &CqtParams) -> Result<Array3<Complex<T>>> {
    let plan = CqtPlan::new(p)?;
    per_channel(y, |y| plan.transform_at_once(y))
}

/// `each` channel's result, stacked.
fn per_channel<T: Lane, R: Clone>(
    y: ArrayView2<T>,
    each: impl Fn(&[T]) -> Result<Array2<R>>,
) -> Result<Array3<R>> {
    require_finite("y", y.iter())?;
    let y = y.as_standard_layout();
    let channels = y
        .rows()
        .into_iter()
        .map(|y| each(y.to_slice().expect("standard layout")))
        .collect::<Result<Vec<_>>>()?;
    let views: Vec<_> = channels.iter().map(Array2::view).collect();
    ndarray::stack(Axis(0), &views).map_err(|_| DspError::Shape {
        name: "y",
        expected: "at least one channel".into(),
        actual: y.shape().to_vec(),
    })
}

/// The signal of octave `i` among those of [`CqtPlan::signals`].
fn of_octave<'s, T: Clone>(signals: &'s [Cow<'_, [T]>], i: usize) -> &'s [T] {
    &signals[i.min(signals.len() - 1)]
}
