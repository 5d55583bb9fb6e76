//! Local derivatives over frames (librosa 0.11 `feature.delta`, scipy `savgol_filter`).

use std::borrow::Cow;

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result, from_name};
use crate::real::Real;
use crate::simd::vectorized;

/// What lies beyond the first and the last frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeltaMode {
    /// The polynomial fitted to the first or last `width` frames.
    #[default]
    Interp,
    /// The edge frame repeated.
    Nearest,
    /// Mirrored without repeating the edge frame.
    Mirror,
    /// Zeros.
    Constant,
    /// Periodic.
    Wrap,
}

from_name!(
    DeltaMode, "mode",
    "interp" => Self::Interp,
    "nearest" => Self::Nearest,
    "mirror" => Self::Mirror,
    "constant" => Self::Constant,
    "wrap" => Self::Wrap,
);

/// Parameters of the derivative, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeltaParams {
    /// Frames of the fit: odd, at least 3.
    pub width: usize,
    /// Order of the derivative and degree of the polynomial, at least 1 and below `width`.
    pub order: usize,
    /// Edge handling.
    pub mode: DeltaMode,
}

impl Default for DeltaParams {
    fn default() -> Self {
        Self { width: 9, order: 1, mode: DeltaMode::Interp }
    }
}

/// Weights `[width]` by which the frames around one give its derivative: `order!` times the leading
/// coefficient of the least-squares polynomial of that degree.
///
/// # Errors
/// An impossible `width` or `order`.
pub fn delta_weights(p: &DeltaParams) -> Result<Vec<f64>> {
    if p.width < 3 || p.width.is_multiple_of(2) {
        return Err(DspError::parameter("width", p.width, "an odd number, at least 3"));
    }
    if p.order == 0 || p.order >= p.width {
        return Err(DspError::parameter("order", p.order, format!("1 to {}", p.width - 1)));
    }
    let half = (p.width / 2) as f64;
    let x: Vec<f64> = (0..p.width).map(|i| i as f64 - half).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Monic orthogonal polynomials on the grid by the three-term recurrence (odd terms vanish).
    let (mut before, mut current) = (vec![0.0; p.width], vec![1.0; p.width]);
    let mut before_norm = 1.0;
    let mut factorial = 1.0;
    for degree in 1..=p.order {
        let norm = dot(&current, &current);
        let b = if degree == 1 { 0.0 } else { norm / before_norm };
        let next: Vec<f64> = (0..p.width).map(|i| x[i] * current[i] - b * before[i]).collect();
        before_norm = norm;
        before = std::mem::replace(&mut current, next);
        factorial *= degree as f64;
    }
    let norm = dot(&current, &current);
    let weights: Vec<f64> = current.iter().map(|v| factorial * v / norm).collect();
    match weights.iter().all(|weight| weight.is_finite()) {
        true => Ok(weights),
        false => {
            let allowed = "low enough for this width that the weights stay finite";
            Err(DspError::parameter("order", p.order, allowed))
        }
    }
}

/// Derivative of each row of `data [rows, frames]` along the frames.
///
/// # Errors
/// Impossible parameters; `interp` with fewer frames than `width`.
pub fn delta<T: Real>(data: ArrayView2<T>, p: &DeltaParams) -> Result<Array2<T>> {
    let weights = delta_weights(p)?;
    let (rows, frames) = data.dim();
    let half = p.width / 2;
    if p.mode == DeltaMode::Interp && frames < p.width {
        let allowed = format!("at most the number of frames ({frames}) in mode interp");
        return Err(DspError::parameter("width", p.width, allowed));
    }
    let mut out = Array2::zeros((rows, frames));
    if out.is_empty() {
        return Ok(out);
    }
    // Frames whose whole window lies inside.
    let first = half.min(frames);
    let inside = first..frames.saturating_sub(half).max(first);
    let shares = out.as_slice_mut().expect("made in C order");
    shares.par_chunks_mut(frames).with_min_len(PART.div_ceil(frames)).enumerate().for_each(
        |(r, out)| {
            let row = data.row(r);
            let row = row.as_slice().map_or_else(|| Cow::Owned(row.to_vec()), Cow::Borrowed);
            vectorized(
                #[inline(always)]
                || slide(&weights, &row, &mut out[inside.clone()]),
            );
            if p.mode == DeltaMode::Interp {
                // The highest derivative of the fitted polynomial is constant over its window.
                let [first, last] = [inside.start, inside.end - 1].map(|t| out[t]);
                out[..inside.start].fill(first);
                out[inside.end..].fill(last);
                return;
            }
            for t in (0..inside.start).chain(inside.end..frames) {
                let value = |(i, w): (usize, &f64)| {
                    let at = (t + i) as isize - half as isize;
                    Some(w * row[p.mode.index(at, frames)?].wide())
                };
                let products = weights.iter().enumerate().filter_map(value);
                out[t] = T::of(products.fold(0.0, |sum, x| sum + x));
            }
        },
    );
    Ok(out)
}

/// Values that one thread takes at least.
const PART: usize = 1 << 14;

/// `out[t]` is the sum of `weights[i] * row[t + i]`.
#[inline(always)]
fn slide<T: Real>(weights: &[f64], row: &[T], out: &mut [T]) {
    const BLOCK: usize = 32;
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    let start = blocks.len() * BLOCK;
    for (b, out) in blocks.iter_mut().enumerate() {
        let mut sums = [0.0; BLOCK];
        for (w, row) in weights.iter().zip(row[b * BLOCK..].windows(BLOCK)) {
            sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += w * x.wide());
        }
        out.iter_mut().zip(sums).for_each(|(slot, sum)| *slot = T::of(sum));
    }
    for (t, out) in rest.iter_mut().enumerate() {
        let products = weights.iter().zip(&row[start + t..]).map(|(w, x)| w * x.wide());
        // From zero, as the blocks: a sum has the same bits wherever it stands.
        *out = T::of(products.fold(0.0, |sum, x| sum + x));
    }
}

impl DeltaMode {
    /// Frame that stands for `i`, which may lie outside `0..n`; `None` for a zero.
    fn index(self, i: isize, n: usize) -> Option<usize> {
        let len = n as isize;
        if (0..len).contains(&i) {
            return Some(i as usize);
        }
        match self {
            Self::Constant => None,
            Self::Interp | Self::Nearest => Some(if i < 0 { 0 } else { n - 1 }),
            Self::Wrap => Some(i.rem_euclid(len) as usize),
            Self::Mirror => crate::stft::PadMode::Reflect.index(i, n),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_order_weights_are_the_regression() {
        let w = delta_weights(&DeltaParams::default()).unwrap();
        for (i, w) in w.iter().enumerate() {
            assert!((w - (i as f64 - 4.0) / 60.0).abs() < 1e-15);
        }
    }

    /// They were NaN, and so was every value.
    #[test]
    fn weights_that_are_not_finite_are_refused() {
        for (width, order) in [(301, 100), (201, 171), (401, 200)] {
            let p = DeltaParams { width, order, ..DeltaParams::default() };
            let refused = delta_weights(&p).unwrap_err().to_string();
            assert!(refused.contains("order") && refused.contains("finite"), "{refused}");
        }
    }

    #[test]
    fn second_derivative_of_a_parabola() {
        let data = Array2::from_shape_fn((1, 12), |(_, t)| 3.0 * (t * t) as f64);
        let p = DeltaParams { order: 2, ..DeltaParams::default() };
        let d = delta(data.view(), &p).unwrap();
        assert!(d.iter().all(|v| (v - 6.0).abs() < 1e-10));
    }

    #[test]
    fn every_frame_is_the_weighted_sum_around_it() {
        use DeltaMode::*;
        for (rows, frames) in [(3, 9), (2, 150), (40, 1000), (1, 64)] {
            let value = |r: usize, t: usize| ((r * 31 + t * t * 7) % 101) as f32;
            let data = Array2::from_shape_fn((rows, frames), |(r, t)| value(r, t));
            let strided = Array2::from_shape_fn((frames, rows), |(t, r)| value(r, t));
            for mode in [Interp, Nearest, Mirror, Constant, Wrap] {
                let p = DeltaParams { mode, ..DeltaParams::default() };
                let weights = delta_weights(&p).unwrap();
                let got = delta(data.view(), &p).unwrap();
                assert_eq!(delta(strided.t(), &p).unwrap(), got);
                for ((r, t), got) in got.indexed_iter() {
                    let center = if mode == Interp { t.clamp(4, frames - 5) } else { t };
                    let at = |i: usize| mode.index((center + i) as isize - 4, frames);
                    let product =
                        |i: usize| at(i).map_or(0.0, |k| weights[i] * data[[r, k]].wide());
                    let want = (0..9).map(product).sum::<f64>() as f32;
                    assert_eq!(*got, want, "{mode:?} {r} {t}");
                }
            }
        }
    }

    #[test]
    fn too_few_frames_only_refuse_in_interp() {
        let data = Array2::<f32>::zeros((1, 4));
        assert!(delta(data.view(), &DeltaParams::default()).is_err());
        let nearest = DeltaParams { mode: DeltaMode::Nearest, ..DeltaParams::default() };
        assert!(delta(data.view(), &nearest).is_ok());
    }
}
