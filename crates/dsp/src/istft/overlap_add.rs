//! Overlap-add of the inverse transforms of rows of frames.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut2, Axis, s};
use num_complex::Complex;
use rayon::prelude::*;

use crate::error::Result;
use crate::lanes::{Lanes, Spectrum};
use crate::pool::Pool;
use crate::real::Real;
use crate::simd::vectorized;
use crate::stft::StftParams;
use crate::transform::SquareSums;
use crate::window::padded_window;

/// Fewest blocks of frames that one thread takes at a time.
const BLOCKS: usize = 4;
/// Hops of a part for each that its first frames reach back, at least: these frames are transformed again.
const OWN: usize = 4;
/// Samples of a hop that are taken from the sums together: their rows stay in the nearest cache.
const SIDE: usize = 128;

/// The inverse for one set of parameters, in the precision of the rows `R`.
///
/// Sums are laid out hop by hop: those of sample `r` of successive hops are neighbours, as are the samples of
/// successive frames in a row of transforms. A sum has its frames in order of time, wherever parts and
/// blocks begin.
pub(super) struct OverlapAdd<R: Lanes> {
    params: StftParams,
    /// `1 / n_fft`, which the inverse transform lacks, included.
    window: Vec<R::Value>,
    squares: SquareSums,
    spectrum: Spectrum<R>,
    /// Hops before its last one that a frame reaches.
    ahead: usize,
    /// Hops of a part, and frames that reach them.
    own: usize,
    frames: usize,
    memory: Pool<Memory<R>>,
}

/// What one thread works with.
struct Memory<R: Lanes> {
    rows: Vec<R>,
    spectrum: Vec<R>,
    sums: Vec<R::Value>,
}

impl<R: Lanes> Default for Memory<R> {
    fn default() -> Self {
        Self { rows: Vec::new(), spectrum: Vec::new(), sums: Vec::new() }
    }
}

impl<R: Lanes> OverlapAdd<R> {
    /// # Errors
    /// Impossible parameters.
    pub fn new(params: &StftParams) -> Result<Self> {
        params.check()?;
        let window = padded_window(&params.window, params.win_length, params.n_fft)?;
        let squares = SquareSums::new(&window, params.hop_length);
        let scale = 1.0 / params.n_fft as f64;
        let ahead = params.n_fft.div_ceil(params.hop_length) - 1;
        let blocks = ((OWN + 1) * ahead).div_ceil(R::SLOTS).max(BLOCKS);
        Ok(Self {
            params: params.clone(),
            window: window.into_iter().map(|w| R::Value::of(w * scale)).collect(),
            squares,
            spectrum: Spectrum::new(params.n_fft)?,
            ahead,
            own: blocks * R::SLOTS - ahead,
            frames: blocks * R::SLOTS,
            memory: Pool::default(),
        })
    }

    /// The signals of `spectra [channels, bins, frames]` into the rows of `out`, contiguous.
    pub fn run<T: Real>(&self, spectra: ArrayView3<Complex<T>>, mut out: ArrayViewMut2<T>) {
        let (hop, pad) = (self.params.hop_length, self.params.pad());
        let frames = self.params.frames_within(out.ncols(), spectra.len_of(Axis(2)));
        let spectra = spectra.slice(s![.., .., ..frames]);
        let mut parts = Vec::new();
        for (channel, y) in out.axis_iter_mut(Axis(0)).enumerate() {
            let y = y.into_slice().expect("contiguous");
            // The first part lacks the padding.
            let (first, rest) = y.split_at_mut((self.own.saturating_mul(hop) - pad).min(y.len()));
            let all = std::iter::once(first).chain(rest.chunks_mut(self.own.saturating_mul(hop)));
            parts.extend(all.enumerate().map(|(part, y)| (part, channel, y)));
        }
        // Channels may lie side by side: what is read of one is near for the next.
        parts.sort_by_key(|(part, ..)| *part);
        let steady: Vec<T> = (0..self.height())
            .map(|r| self.squares.divisor(self.ahead + 1, self.ahead * hop + r))
            .collect();
        parts.into_par_iter().for_each(|(part, channel, y)| {
            self.part(part, spectra.index_axis(Axis(0), channel), &steady, y);
        });
    }

    /// Samples of a hop that frames reach.
    fn height(&self) -> usize {
        self.params.hop_length.min(self.params.n_fft)
    }

    /// Sums of the same sample of successive hops.
    fn width(&self) -> usize {
        self.frames + self.ahead
    }

    /// Part `part` of a channel into `y`.
    fn part<T: Real>(
        &self,
        part: usize,
        spectra: ArrayView2<Complex<T>>,
        steady: &[T],
        y: &mut [T],
    ) {
        let start = part * self.own;
        let from = start.saturating_sub(self.ahead);
        let end = spectra.ncols().min(start + self.own);
        let mut memory = self.memory.take().unwrap_or_default();
        let Memory { rows, spectrum, sums } = &mut memory;
        rows.resize(self.params.n_fft, R::EMPTY);
        spectrum.resize(2 * self.params.n_bins(), R::EMPTY);
        sums.clear();
        sums.resize(self.height() * self.width(), R::Value::of(0.0));
        for first in (from..end).step_by(R::SLOTS) {
            let count = R::SLOTS.min(end - first);
            load(spectra.slice(s![.., first..first + count]), rows);
            self.spectrum.complex(rows, spectrum);
            self.add(spectrum, first - from, sums);
        }
        self.divide(sums, start - from, (start, spectra.ncols()), steady, y);
        self.memory.give_back(memory);
    }

    /// Adds a row of frames to the sums, of which the first reaches the hops from `at` on.
    fn add(&self, spectrum: &[R], at: usize, sums: &mut [R::Value]) {
        let (n, hop, width) = (self.params.n_fft, self.params.hop_length, self.width());
        let bins = spectrum.as_chunks::<2>().0;
        vectorized(
            #[inline(always)]
            || {
                // A side at a time, which stays in the nearest cache.
                for (side, sums) in sums.chunks_mut(SIDE * width).enumerate() {
                    for c in (0..=self.ahead).rev() {
                        let first = c * hop + side * SIDE;
                        let samples = first..n.min(first + sums.len() / width);
                        for (i, sums) in samples.zip(sums.chunks_exact_mut(width)) {
                            let (bin, sign) = if i <= n / 2 { (i, -1.0) } else { (n - i, 1.0) };
                            let (w, sign) = (self.window[i], R::Value::of(sign));
                            let [re, im] = &bins[bin];
                            let sums = sums[at + c..].iter_mut();
                            for (sum, (re, im)) in sums.zip(re.values().iter().zip(im.values())) {
                                *sum += w * (*re + sign * *im);
                            }
                        }
                    }
                }
            },
        );
    }

    /// The sums from hop `at` on, which is hop `start` of all, over those of the squared windows of `frames` frames.
    fn divide<T: Real>(
        &self,
        sums: &[R::Value],
        at: usize,
        (start, frames): (usize, usize),
        steady: &[T],
        y: &mut [T],
    ) {
        let (hop, width, height) = (self.params.hop_length, self.width(), self.height());
        let cut = if start == 0 { self.params.pad() } else { 0 };
        if height < hop {
            y.fill(T::zero());
        }
        for side in (0..height).step_by(SIDE) {
            for j in 0..self.own {
                let hops_before = j.saturating_mul(hop);
                // Samples of this hop that `y` has.
                let first = cut.saturating_sub(hops_before).max(side);
                let end = (y.len() + cut).saturating_sub(hops_before).min(height.min(side + SIDE));
                if first >= end {
                    continue;
                }
                let place = hops_before + first - cut;
                let slots = y[place..place + end - first].iter_mut();
                let values = sums[first * width + at + j..].iter().step_by(width);
                let values = values.map(|sum| T::of(sum.wide()));
                let hops = start + j;
                if (self.ahead..frames).contains(&hops) {
                    let divisors = &steady[first..end];
                    slots.zip(values).zip(divisors).for_each(|((y, x), sum)| *y = x / *sum);
                } else {
                    for (r, (y, x)) in (first..end).zip(slots.zip(values)) {
                        *y = x / self.squares.divisor(frames, hops * hop + r);
                    }
                }
            }
        }
    }
}

/// The frames of `spectra`, a row of them or fewer, as real sequences of which the transforms are the inverse
/// transforms, with mirrored halves to be added and subtracted (Hartley's transform). Bins that are missing are
/// zero. A real signal has no imaginary part at zero and at half the sample rate.
fn load<T: Real, R: Lanes>(spectra: ArrayView2<Complex<T>>, rows: &mut [R]) {
    let n = rows.len();
    vectorized(
        #[inline(always)]
        || {
            for k in 0..=n / 2 {
                let (mut low, mut high) = (R::EMPTY, R::EMPTY);
                if k < spectra.nrows() {
                    let (bin, real) = (spectra.row(k), k == 0 || 2 * k == n);
                    let slots = low.values_mut().iter_mut().zip(high.values_mut());
                    match bin.to_slice() {
                        // A length that is known makes vectors of it.
                        Some(bin) if bin.len() == R::SLOTS => {
                            for ((low, high), z) in slots.zip(&bin[..R::SLOTS]) {
                                (*low, *high) = halves(z, real);
                            }
                        }
                        _ => slots.zip(bin).for_each(|((low, high), z)| {
                            (*low, *high) = halves(z, real);
                        }),
                    }
                }
                rows[k] = low;
                if k > 0 {
                    rows[n - k] = high;
                }
            }
        },
    );
}

/// What bin `z` and its mirror image become.
#[inline(always)]
fn halves<T: Real, V: Real>(z: &Complex<T>, real: bool) -> (V, V) {
    let (re, im) = (V::of(z.re.wide()), V::of(z.im.wide()));
    if real { (re, re) } else { (re - im, re + im) }
}
