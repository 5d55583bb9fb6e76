//! `[channels, rows, frames]` arrays written in parallel, a few frames of a channel at a time.

use ndarray::{
    Array2, ArrayView2, ArrayViewMut1, ArrayViewMut2, ArrayViewMut3, Axis, CowArray, Ix2,
};
use num_traits::Float;
use rayon::prelude::*;

use crate::error::Result;
use crate::lanes::{LANES, Lanes, Spectrum, square_roots};
use crate::pool::Pool;
use crate::real::Real;
use crate::stft::StftParams;
use crate::window::padded_window;

/// Frames of a tile: enough that neighbouring tiles seldom share a cache line.
const WIDTH: usize = 8 * LANES;

/// Samples of every channel that [`planar`] takes at a time: eight channels of them fit a cache.
const SPAN: usize = 1 << 13;

/// A few frames of one channel of the result.
pub(crate) struct Tile<'a, T> {
    pub channel: usize,
    /// The first frame.
    pub first: usize,
    /// `[rows, frames]`.
    pub out: ArrayViewMut2<'a, T>,
}

/// Calls `each` with every tile of `out`, on all threads of the pool. `state` is what one thread
/// works with; results must not depend on what it holds.
pub(crate) fn for_each_tile<T: Send, S: Send>(
    mut out: ArrayViewMut3<T>,
    state: impl Fn() -> S + Sync,
    each: impl Fn(&mut S, Tile<T>) + Sync,
) {
    let mut tiles = Vec::new();
    for (channel, part) in out.outer_iter_mut().enumerate() {
        let parts = split(part, WIDTH).into_iter().enumerate();
        tiles.extend(parts.map(|(i, out)| Tile { channel, first: i * WIDTH, out }));
    }
    // Several parts for each thread, so that a late one does not matter.
    let share = tiles.len().div_ceil(4 * rayon::current_num_threads()).max(1);
    let mut shares = Vec::new();
    while !tiles.is_empty() {
        let rest = tiles.split_off(share.min(tiles.len()));
        shares.push(std::mem::replace(&mut tiles, rest));
    }
    // As many states as there are threads at work.
    let idle = Pool::default();
    shares.into_par_iter().for_each(|share| {
        let mut state = idle.take().unwrap_or_else(&state);
        share.into_iter().for_each(|tile| each(&mut state, tile));
        idle.give_back(state);
    });
}

/// `part` cut every `width` columns.
fn split<T>(mut part: ArrayViewMut2<T>, width: usize) -> Vec<ArrayViewMut2<T>> {
    let mut parts = Vec::new();
    while part.ncols() > width {
        let (left, right) = part.split_at(Axis(1), width);
        parts.push(left);
        part = right;
    }
    parts.push(part);
    parts
}

/// `y [channels, samples]` with every channel contiguous; interleaved signals are copied in parallel.
pub(crate) fn planar<T: Real>(y: ArrayView2<T>) -> CowArray<T, Ix2> {
    if y.is_standard_layout() {
        return y.into();
    }
    let Some(frames) = y.reversed_axes().to_slice() else {
        return y.as_standard_layout().into_owned().into();
    };
    let channels = y.nrows();
    let mut out = Array2::zeros(y.raw_dim());
    let parts = split(out.view_mut(), SPAN).into_par_iter();
    parts.zip(frames.par_chunks(SPAN * channels)).for_each(|(mut part, frames)| {
        for (c, mut channel) in part.outer_iter_mut().enumerate() {
            let samples = frames[c..].iter().step_by(channels);
            channel.iter_mut().zip(samples).for_each(|(slot, x)| *slot = *x);
        }
    });
    out.into()
}

/// Spectra of a row of frames of a channel at a time: what threads share.
pub(crate) struct LanePlan<R: Lanes> {
    params: StftParams,
    window: Vec<R::Value>,
    spectrum: Spectrum<R>,
}

impl<R: Lanes> LanePlan<R> {
    /// # Errors
    /// Impossible parameters.
    pub fn new(params: &StftParams) -> Result<Self> {
        params.check()?;
        let window = padded_window(&params.window, params.win_length, params.n_fft)?;
        let window = window.into_iter().map(R::Value::of).collect();
        Ok(Self { params: params.clone(), window, spectrum: Spectrum::new(params.n_fft)? })
    }

    /// As given.
    pub fn params(&self) -> &StftParams {
        &self.params
    }

    /// What one thread works with.
    pub fn frames(&self) -> LaneFrames<'_, R> {
        // Frames that do not overlap are laid side by side.
        let hop = self.params.hop_length.min(self.params.n_fft);
        LaneFrames {
            plan: self,
            hop,
            samples: vec![R::Value::of(0.0); (R::SLOTS - 1) * hop + self.params.n_fft],
            rows: vec![R::EMPTY; self.params.n_fft],
        }
    }
}

/// A row of frames of a channel at a time.
pub(crate) struct LaneFrames<'p, R: Lanes> {
    plan: &'p LanePlan<R>,
    hop: usize,
    samples: Vec<R::Value>,
    rows: Vec<R>,
}

impl<R: Lanes> LaneFrames<'_, R> {
    fn load<T: Real>(&mut self, y: &[T], first: usize) {
        let LanePlan { params: p, window, .. } = self.plan;
        let start = |t: usize| (t * p.hop_length) as isize - p.pad() as isize;
        if p.hop_length > p.n_fft {
            let frames = first..p.n_frames(y.len());
            for (t, samples) in frames.zip(self.samples.chunks_exact_mut(p.n_fft)) {
                p.pad_mode.read(y, start(t), samples);
            }
            return R::gather(&self.samples, self.hop, window, &mut self.rows);
        }
        let start = start(first);
        let inside = usize::try_from(start).ok().and_then(|s| y.get(s..s + self.samples.len()));
        if let Some(samples) = inside {
            return R::gather(samples, self.hop, window, &mut self.rows);
        }
        p.pad_mode.read(y, start, &mut self.samples);
        R::gather(&self.samples, self.hop, window, &mut self.rows);
    }

    /// Real and imaginary parts of the frames from `first` on into the even and the odd rows of
    /// `out` (`2 n_bins` rows).
    pub fn complex<T: Real>(&mut self, y: &[T], first: usize, out: &mut [R]) {
        self.load(y, first);
        self.plan.spectrum.complex(&mut self.rows, out);
    }

    /// `|X|^power` of the frames from `first` on into `out` (`n_bins` rows).
    pub fn power<T: Real>(&mut self, y: &[T], first: usize, power: f64, out: &mut [R]) {
        self.load(y, first);
        self.plan.spectrum.power(&mut self.rows, out);
        if power == 1.0 {
            square_roots(out);
        } else if power != 2.0 {
            let exponent = R::Value::of(power / 2.0);
            let values = out.iter_mut().flat_map(R::values_mut);
            values.for_each(|x| *x = Float::powf(*x, exponent));
        }
    }
}

/// A row of a tile: its frames are neighbours in memory.
pub(crate) fn neighbours<T>(row: ArrayViewMut1<'_, T>) -> &mut [T] {
    row.into_slice().expect("made in C order")
}

/// Writes the columns of `part` one after another into `columns`.
pub(crate) fn read_columns<T: Copy>(part: ArrayView2<T>, columns: &mut [T]) {
    let rows = part.nrows();
    // A square at a time, so that the lines of both sides stay in the cache.
    for (b, part) in part.axis_chunks_iter(Axis(0), LANES).enumerate() {
        if part.dim() == (LANES, LANES) {
            let mut square = [[part[[0, 0]]; LANES]; LANES];
            for (values, row) in square.iter_mut().zip(part.outer_iter()) {
                values.iter_mut().zip(row).for_each(|(value, x)| *value = *x);
            }
            for (t, column) in columns.chunks_exact_mut(rows).take(LANES).enumerate() {
                let slots = &mut column[b * LANES..(b + 1) * LANES];
                slots.copy_from_slice(&square.map(|row| row[t]));
            }
            continue;
        }
        for (k, row) in part.outer_iter().enumerate() {
            let slots = columns[b * LANES + k..].iter_mut().step_by(rows);
            slots.zip(row).for_each(|(slot, x)| *slot = *x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn every_value_is_in_one_tile() {
        for (channels, frames) in [(3, 500), (1, 1), (2, 128), (2, 0), (1, 129)] {
            let mut a = Array3::<usize>::zeros((channels, 2, frames));
            for_each_tile(
                a.view_mut(),
                || (),
                |(), mut tile| {
                    for ((k, t), x) in tile.out.indexed_iter_mut() {
                        *x += 1 + 10_000 * tile.channel + 1000 * k + tile.first + t;
                    }
                },
            );
            for ((c, k, t), x) in a.indexed_iter() {
                assert_eq!(*x, 1 + 10_000 * c + 1000 * k + t);
            }
        }
    }

    #[test]
    fn interleaved_signals_become_planar() {
        for (channels, n) in [(8, 20_000), (1, 5), (3, 0), (2, 8192)] {
            let frames = Array2::from_shape_fn((n, channels), |(i, c)| (i * channels + c) as f64);
            assert_eq!(planar(frames.t()), frames.t());
            assert!(planar(frames.t()).is_standard_layout());
            let y = frames.t().as_standard_layout().into_owned();
            assert!(planar(y.view()).is_view());
        }
    }

    #[test]
    fn columns_are_transposed() {
        for width in [5, LANES, LANES + 1] {
            let part = Array2::from_shape_fn((37, width), |(k, t)| t * 37 + k);
            let turned = part.t().as_standard_layout().into_owned();
            for part in [part.view(), turned.t()] {
                let mut columns = vec![0; part.len()];
                read_columns(part, &mut columns);
                assert!(columns.into_iter().eq(0..width * 37));
            }
        }
    }
}
