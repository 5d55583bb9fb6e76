//! Local derivatives over frames (librosa 0.11 `feature.delta`, scipy `savgol_filter`).

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};
use crate::real::Real;

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
    Ok(current.iter().map(|v| factorial * v / norm).collect())
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
    for r in 0..rows {
        for t in 0..frames {
            // The highest derivative of the fitted polynomial is constant over its window, so
            // `interp` repeats the value at the first and last full window.
            let center = match p.mode {
                DeltaMode::Interp => t.clamp(half, frames - 1 - half),
                _ => t,
            };
            let sum: f64 = weights
                .iter()
                .enumerate()
                .filter_map(|(i, w)| {
                    let at = (center + i) as isize - half as isize;
                    Some(w * data[[r, p.mode.index(at, frames)?]].wide())
                })
                .sum();
            out[[r, t]] = T::of(sum);
        }
    }
    Ok(out)
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

    #[test]
    fn second_derivative_of_a_parabola() {
        let data = Array2::from_shape_fn((1, 12), |(_, t)| 3.0 * (t * t) as f64);
        let p = DeltaParams { order: 2, ..DeltaParams::default() };
        let d = delta(data.view(), &p).unwrap();
        assert!(d.iter().all(|v| (v - 6.0).abs() < 1e-10));
    }

    #[test]
    fn too_few_frames_only_refuse_in_interp() {
        let data = Array2::<f32>::zeros((1, 4));
        assert!(delta(data.view(), &DeltaParams::default()).is_err());
        let nearest = DeltaParams { mode: DeltaMode::Nearest, ..DeltaParams::default() };
        assert!(delta(data.view(), &nearest).is_ok());
    }
}
