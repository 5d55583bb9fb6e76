//! Chromagram of the constant-Q transform (librosa 0.11 `filters.cq_to_chroma`,
//! `feature.chroma_cqt`).

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, Axis};
use rayon::prelude::*;

use super::{C1, CqtParams, CqtPlan, Octave, per_channel};
use crate::error::{DspError, Result};
use crate::normalize::Norm;
use crate::real::{Real, require_finite};
use crate::simd::vectorized;
use crate::vector::Lane;

/// Parameters of the folding of bins into pitch classes, in librosa's names.
#[derive(Debug, Clone, PartialEq)]
pub struct ChromaCqtParams {
    /// Bins of the transform per octave, a multiple of `n_chroma`.
    pub bins_per_octave: usize,
    /// Pitch classes per octave.
    pub n_chroma: usize,
    /// Lowest centre frequency in Hz.
    pub fmin: f64,
    /// Weights that smooth the matrix along its bins.
    pub window: Option<Vec<f64>>,
    /// Rows start at C instead of A.
    pub base_c: bool,
    /// Smaller values become 0, before the normalisation.
    pub threshold: Option<f64>,
    /// Normalisation of each frame.
    pub norm: Option<Norm>,
}

impl Default for ChromaCqtParams {
    fn default() -> Self {
        Self {
            bins_per_octave: 36,
            n_chroma: 12,
            fmin: C1,
            window: None,
            base_c: true,
            threshold: Some(0.0),
            norm: Some(Norm::Max),
        }
    }
}

/// The matrix `[n_chroma, n_input]` that folds the bins of a constant-Q transform into pitch
/// classes; of the parameters only the shape of the matrix counts, not threshold and norm.
///
/// # Errors
/// `bins_per_octave` that is not a multiple of `n_chroma`, or an impossible `fmin`.
pub fn cq_to_chroma(n_input: usize, p: &ChromaCqtParams) -> Result<Array2<f32>> {
    if p.n_chroma == 0 {
        return Err(DspError::parameter("n_chroma", 0, "at least 1"));
    }
    if p.bins_per_octave == 0 || !p.bins_per_octave.is_multiple_of(p.n_chroma) {
        let allowed = format!("a multiple of n_chroma = {}", p.n_chroma);
        return Err(DspError::parameter("bins_per_octave", p.bins_per_octave, allowed));
    }
    if n_input == 0 {
        return Err(DspError::parameter("n_input", 0, "at least 1"));
    }
    if !(p.fmin.is_finite() && p.fmin > 0.0) {
        return Err(DspError::parameter("fmin", p.fmin, "above 0 Hz"));
    }
    let merged = p.bins_per_octave / p.n_chroma;
    // Class of the first bin; MIDI note 0 is a C.
    let note = (12.0 * (p.fmin / 440.0).log2() + 69.0).rem_euclid(12.0);
    let from = if p.base_c { note } else { note - 9.0 };
    let roll = (from * (p.n_chroma as f64 / 12.0)).round_ties_even() as isize;
    let mut matrix = Array2::zeros((p.n_chroma, n_input));
    for k in 0..n_input {
        // Neighbours are centred on their class.
        let class = (k + merged / 2) % p.bins_per_octave / merged;
        let row = (class as isize + roll).rem_euclid(p.n_chroma as isize);
        matrix[[row as usize, k]] = 1.0;
    }
    Ok(match &p.window {
        Some(window) => smoothed(&matrix, window),
        None => matrix,
    })
}

/// Each row convolved with `window`, the middle part of the shape of `matrix`.
fn smoothed(matrix: &Array2<f32>, window: &[f64]) -> Array2<f32> {
    let n = matrix.ncols();
    let lead = window.len().saturating_sub(1) / 2;
    Array2::from_shape_fn(matrix.dim(), |(row, k)| {
        let at = |(j, w): (usize, &f64)| {
            let source = (k + lead).checked_sub(j).filter(|i| *i < n)?;
            Some(w * f64::from(matrix[[row, source]]))
        };
        window.iter().enumerate().filter_map(at).sum::<f64>() as f32
    })
}

/// Folds constant-Q magnitudes into a chromagram.
#[derive(Debug, Clone)]
pub struct ChromaCqt {
    /// Weight and bin of every contribution to each class.
    classes: Vec<Vec<(f32, usize)>>,
    n_input: usize,
    threshold: Option<f64>,
    norm: Option<Norm>,
}

impl ChromaCqt {
    /// # Errors
    /// As [`cq_to_chroma`].
    pub fn new(n_input: usize, p: &ChromaCqtParams) -> Result<Self> {
        let matrix = cq_to_chroma(n_input, p)?;
        let nonzero = |row: ndarray::ArrayView1<f32>| {
            row.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(k, w)| (*w, k)).collect()
        };
        let classes = matrix.axis_iter(Axis(0)).map(nonzero).collect();
        Ok(Self { classes, n_input, threshold: p.threshold, norm: p.norm })
    }

    /// Chromagram `[n_chroma, frames]` of the bins `k` whose magnitudes `row(k)` gives.
    fn fold<T: Real>(&self, frames: usize, mut add: impl FnMut(usize, f32, &mut [T])) -> Array2<T> {
        let mut chroma = Array2::zeros((self.classes.len(), frames));
        for (class, mut row) in self.classes.iter().zip(chroma.rows_mut()) {
            let row = row.as_slice_mut().expect("a new array");
            class.iter().for_each(|(w, k)| add(*k, *w, row));
        }
        self.finish(&mut chroma);
        chroma
    }

    /// Threshold and norm of every frame.
    fn finish<T: Real>(&self, chroma: &mut Array2<T>) {
        if let Some(threshold) = self.threshold.map(T::of) {
            chroma.mapv_inplace(|x| if x < threshold { T::zero() } else { x });
        }
        if let Some(norm) = self.norm {
            let mut frame = vec![T::zero(); self.classes.len()];
            for mut column in chroma.columns_mut() {
                frame.iter_mut().zip(&column).for_each(|(slot, x)| *slot = *x);
                norm.normalize(&mut frame);
                column.iter_mut().zip(&frame).for_each(|(slot, x)| *slot = *x);
            }
        }
    }

    /// Chromagram `[n_chroma, frames]` of the constant-Q transform of one channel, of which only
    /// the magnitudes at hand are kept.
    ///
    /// # Errors
    /// As [`CqtPlan::transform`].
    ///
    /// # Panics
    /// When `plan` has another number of bins.
    pub fn of_signal<T: Lane>(&self, plan: &CqtPlan, y: &[T]) -> Result<Array2<T>> {
        assert_eq!(plan.params().n_bins, self.n_input, "bins of the transform");
        let mut parts = vec![Vec::new(); self.n_input];
        for (class, bins) in self.classes.iter().enumerate() {
            bins.iter().for_each(|(w, k)| parts[*k].push((class, T::of(f64::from(*w)))));
        }
        let mut chroma = Array2::zeros((self.classes.len(), plan.n_frames(y.len())));
        plan.respond_to(y, |bin, frame, re, im| {
            for (class, w) in &parts[bin] {
                let mut row = chroma.row_mut(*class);
                let row = &mut row.as_slice_mut().expect("a new array")[frame..];
                add_magnitudes(row, *w, re.iter().copied().zip(im.iter().copied()));
            }
        })?;
        self.finish(&mut chroma);
        Ok(chroma)
    }

    /// [`of_signal`](Self::of_signal) with the same bits, on all threads of the pool, with the whole
    /// transform in memory unless that is large.
    fn of_signal_at_once<T: Lane>(&self, plan: &CqtPlan, y: &[T]) -> Result<Array2<T>> {
        let frames = plan.n_frames(y.len());
        if self.n_input.saturating_mul(frames) > HELD {
            return self.of_signal(plan, y);
        }
        let transform = plan.transform_at_once(y)?;
        let mut chroma = Array2::zeros((self.classes.len(), frames));
        let rows: Vec<_> = chroma.outer_iter_mut().zip(&self.classes).collect();
        rows.into_par_iter().for_each(|(mut row, class)| {
            let row = row.as_slice_mut().expect("a new array");
            // Sums in the order in which the bins of one octave after another come.
            for bin in plan.octaves.iter().flat_map(Octave::bins) {
                for (w, _) in class.iter().filter(|(_, k)| *k == bin) {
                    let values = transform.row(bin).to_slice().expect("a new array");
                    let w = T::of(f64::from(*w));
                    add_magnitudes(row, w, values.iter().map(|z| (z.re, z.im)));
                }
            }
        });
        self.finish(&mut chroma);
        Ok(chroma)
    }

    /// Chromagram `[channels, n_chroma, frames]` of magnitudes `[channels, n_input, frames]`.
    ///
    /// # Errors
    /// Another number of bins, or values that are not finite where a norm is taken.
    pub fn of_magnitudes<T: Real>(&self, c: ArrayView3<T>) -> Result<Array3<T>> {
        let (channels, bins, frames) = c.dim();
        if bins != self.n_input {
            let expected = format!("{} bins", self.n_input);
            return Err(DspError::Shape { name: "C", expected, actual: c.shape().to_vec() });
        }
        if self.norm.is_some() {
            require_finite("C", c)?;
        }
        let mut chroma = Array3::zeros((channels, self.classes.len(), frames));
        for (c, mut chroma) in c.outer_iter().zip(chroma.outer_iter_mut()) {
            chroma.assign(&self.fold(frames, |k, w, row| {
                let w = T::of(f64::from(w));
                row.iter_mut().zip(c.row(k)).for_each(|(sum, x)| *sum += w * *x);
            }));
        }
        Ok(chroma)
    }
}

/// Chromagram `[channels, n_chroma, frames]` of `y [channels, samples]` by a constant-Q transform
/// (`feature.chroma_cqt` with a given tuning). Channels are independent.
///
/// # Errors
/// As [`CqtPlan::new`], [`CqtPlan::transform`] and [`cq_to_chroma`], or samples that are not finite.
pub fn chroma_cqt<T: Lane>(
    y: ArrayView2<T>,
    cqt: &CqtParams,
    p: &ChromaCqtParams,
) -> Result<Array3<T>> {
    let fold = ChromaCqt::new(cqt.n_bins, p)?;
    let plan = CqtPlan::new(cqt)?;
    per_channel(y, |y| fold.of_signal_at_once(&plan, y))
}

/// Most values of a transform that is held whole: 128 MiB in single precision.
const HELD: usize = 1 << 24;

/// Adds `w` times the magnitudes of `values` (real and imaginary parts) to `row`.
fn add_magnitudes<T: Real>(row: &mut [T], w: T, values: impl Iterator<Item = (T, T)>) {
    vectorized(
        #[inline(always)]
        || {
            for (sum, (re, im)) in row.iter_mut().zip(values) {
                let (re, im) = (re.wide(), im.wide());
                *sum += w * T::of((re * re + im * im).sqrt());
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_over_the_bins_give_the_same_bits() {
        let y: Vec<f32> = (0..30_000).map(|i| ((i * i) % 257) as f32 / 257.0 - 0.5).collect();
        for bins_per_octave in [12, 36] {
            let p = ChromaCqtParams {
                bins_per_octave,
                window: Some(vec![1.0, 2.0, 1.0]),
                ..ChromaCqtParams::default()
            };
            let params = CqtParams {
                bins_per_octave,
                n_bins: 5 * bins_per_octave,
                ..CqtParams::new(22050.0)
            };
            let (fold, plan) =
                (ChromaCqt::new(params.n_bins, &p).unwrap(), CqtPlan::new(&params).unwrap());
            let want = fold.of_signal(&plan, &y).unwrap();
            assert_eq!(fold.of_signal_at_once(&plan, &y).unwrap(), want);
        }
    }

    #[test]
    fn three_neighbours_are_centred_on_their_class() {
        let m = cq_to_chroma(252, &ChromaCqtParams::default()).unwrap();
        assert_eq!(m.dim(), (12, 252));
        let of_c: Vec<usize> = (0..36).filter(|k| m[[0, *k]] == 1.0).collect();
        assert_eq!(of_c, [0, 1, 35]);
        let a = ChromaCqtParams { base_c: false, ..ChromaCqtParams::default() };
        assert_eq!(cq_to_chroma(36, &a).unwrap()[[3, 0]], 1.0);
        let bad = ChromaCqtParams { n_chroma: 10, ..ChromaCqtParams::default() };
        assert!(cq_to_chroma(252, &bad).is_err());
    }

    #[test]
    fn a_window_smooths_along_the_bins() {
        let p = ChromaCqtParams {
            bins_per_octave: 12,
            window: Some(vec![1.0, 2.0, 3.0]),
            ..ChromaCqtParams::default()
        };
        let m = cq_to_chroma(12, &p).unwrap();
        assert_eq!([m[[4, 3]], m[[4, 4]], m[[4, 5]]], [1.0, 2.0, 3.0]);
    }
}
