//! Forward and inverse transforms of single frames, with everything that recordings share made
//! once.

use std::sync::Arc;

use num_complex::Complex;
use realfft::{ComplexToReal, RealToComplex};

use crate::error::Result;
use crate::real::Real;
use crate::stft::StftParams;
use crate::window::{Window, padded_window};

/// Windowed forward transform of frames in the precision `F`.
#[derive(Clone)]
pub struct Forward<F: Real> {
    params: StftParams,
    /// `None` for a rectangular window of the whole frame.
    window: Option<Vec<F>>,
    fft: Arc<dyn RealToComplex<F>>,
}

/// Working memory of a transform, for one thread.
pub struct Scratch<F> {
    frame: Vec<F>,
    spectrum: Vec<Complex<F>>,
    fft: Vec<Complex<F>>,
}

impl<F> Scratch<F> {
    /// The `n_fft / 2 + 1` bins of the frame at hand.
    pub fn bins(&mut self) -> &mut [Complex<F>] {
        &mut self.spectrum
    }
}

impl<F: Real> Forward<F> {
    /// # Errors
    /// Impossible parameters.
    pub fn new(params: &StftParams) -> Result<Self> {
        params.check()?;
        let flat = params.window == Window::Boxcar && params.win_length == params.n_fft;
        let window = if flat {
            None
        } else {
            let window = padded_window(&params.window, params.win_length, params.n_fft)?;
            Some(window.into_iter().map(F::of).collect())
        };
        let fft = F::forward_transform(params.n_fft);
        Ok(Self { params: params.clone(), window, fft })
    }

    /// The parameters of the transform.
    pub fn params(&self) -> &StftParams {
        &self.params
    }

    /// Working memory for [`spectrum`](Self::spectrum).
    pub fn scratch(&self) -> Scratch<F> {
        Scratch {
            frame: self.fft.make_input_vec(),
            spectrum: self.fft.make_output_vec(),
            fft: self.fft.make_scratch_vec(),
        }
    }

    /// Spectrum of frame `t` of `y`, `n_fft / 2 + 1` values.
    pub fn spectrum<'s, T: Real>(
        &self,
        y: &[T],
        t: usize,
        scratch: &'s mut Scratch<F>,
    ) -> &'s [Complex<F>] {
        let p = &self.params;
        let start = (t * p.hop_length) as isize - p.pad() as isize;
        let inside = usize::try_from(start).ok().and_then(|s| y.get(s..s + p.n_fft));
        let frame = &mut scratch.frame;
        if inside.is_none() {
            p.pad_mode.read(y, start, frame);
        }
        crate::simd::vectorized(
            #[inline(always)]
            || {
                if let Some(samples) = inside {
                    frame.iter_mut().zip(samples).for_each(|(slot, x)| *slot = F::of(x.wide()));
                }
                if let Some(window) = &self.window {
                    frame.iter_mut().zip(window).for_each(|(x, w)| *x *= *w);
                }
            },
        );
        self.fft
            .process_with_scratch(&mut scratch.frame, &mut scratch.spectrum, &mut scratch.fft)
            .expect("buffers made by the plan itself");
        &scratch.spectrum
    }
}

/// Windowed inverse transform of frames and their overlap-add, in the precision `F`.
#[derive(Clone)]
pub struct Inverse<F: Real> {
    params: StftParams,
    window: Vec<F>,
    squares: SquareSums,
    fft: Arc<dyn ComplexToReal<F>>,
}

/// Sums of the squared windows over samples of overlapping frames.
#[derive(Clone)]
pub(crate) struct SquareSums {
    squares: Vec<f64>,
    hop: usize,
}

impl SquareSums {
    /// Of windows that begin `hop` samples apart.
    pub fn new(window: &[f64], hop: usize) -> Self {
        Self { squares: window.iter().map(|w| w * w).collect(), hop }
    }

    /// Sum of the squared windows of `frames` frames over sample `at` (padding included), 1 where there is none.
    pub fn divisor<F: Real>(&self, frames: usize, at: usize) -> F {
        let first = (at + 1).saturating_sub(self.squares.len()).div_ceil(self.hop);
        let end = frames.min(at / self.hop + 1);
        let sum: f64 = (first..end).map(|t| self.squares[at - t * self.hop]).sum();
        if sum > F::min_positive_value().wide() { F::of(sum) } else { F::one() }
    }
}

impl<F: Real> Inverse<F> {
    /// # Errors
    /// Impossible parameters.
    pub fn new(params: &StftParams) -> Result<Self> {
        params.check()?;
        let window = padded_window(&params.window, params.win_length, params.n_fft)?;
        let squares = SquareSums::new(&window, params.hop_length);
        // The inverse transform is not normalised; its 1 / n_fft goes with the window.
        let scale = 1.0 / params.n_fft as f64;
        let window = window.into_iter().map(|w| F::of(w * scale)).collect();
        let fft = F::inverse_transform(params.n_fft);
        Ok(Self { params: params.clone(), window, squares, fft })
    }

    /// Working memory for [`add`](Self::add).
    pub fn scratch(&self) -> Scratch<F> {
        Scratch {
            frame: self.fft.make_output_vec(),
            spectrum: self.fft.make_input_vec(),
            fft: self.fft.make_scratch_vec(),
        }
    }

    /// Adds frame `t`, whose spectrum is in `scratch`, to the part of `y` that it reaches.
    pub fn add(&self, t: usize, y: &mut [F], scratch: &mut Scratch<F>) {
        let Scratch { frame, spectrum: bins, fft } = scratch;
        // A real signal has no imaginary part at zero and at half the sample rate.
        bins[0].im = F::zero();
        if self.params.n_fft.is_multiple_of(2) {
            bins[self.params.n_fft / 2].im = F::zero();
        }
        self.fft
            .process_with_scratch(bins, frame, fft)
            .expect("buffers made by the plan itself, real ends");
        let (skip, y) = overlap(&self.params, t, y);
        crate::simd::vectorized(
            #[inline(always)]
            || {
                for ((y, x), w) in y.iter_mut().zip(&frame[skip..]).zip(&self.window[skip..]) {
                    *y += *x * *w;
                }
            },
        );
    }

    /// Divides `y` by the sum of the squared windows of `frames` frames, where there is any.
    pub fn normalize(&self, frames: usize, y: &mut [F]) {
        let (hop, pad) = (self.params.hop_length, self.params.pad());
        // Between the first whole window and the last frame's start the sum repeats every hop.
        let steady_from = (self.params.n_fft - 1).saturating_sub(pad).min(y.len());
        let steady_to = (frames * hop).saturating_sub(pad).clamp(steady_from, y.len());
        let steady = &mut y[steady_from..steady_to];
        let sums: Vec<F> = (0..hop.min(steady.len()))
            .map(|i| self.squares.divisor(frames, pad + steady_from + i))
            .collect();
        crate::simd::vectorized(
            #[inline(always)]
            || {
                for y in steady.chunks_mut(hop) {
                    y.iter_mut().zip(&sums).for_each(|(y, sum)| *y /= *sum);
                }
            },
        );
        for i in (0..steady_from).chain(steady_to..y.len()) {
            y[i] /= self.squares.divisor(frames, pad + i);
        }
    }
}

/// The part of `y` from the start of frame `t` on, and how many of the frame's samples lie before
/// `y`.
fn overlap<'y, F>(p: &StftParams, t: usize, y: &'y mut [F]) -> (usize, &'y mut [F]) {
    let start = t * p.hop_length;
    let skip = p.pad().saturating_sub(start).min(p.n_fft);
    let from = start.saturating_sub(p.pad()).min(y.len());
    (skip, &mut y[from..])
}
