//! Statistics of short-term features over longer windows.

use ndarray::{Array1, Array2, ArrayView2, Axis, s};

use crate::error::{DspError, Result};

/// Mid-term windows in short-term frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MidTerm {
    /// Frames per window (the last windows are shorter).
    pub window: usize,
    /// Frames between windows.
    pub step: usize,
}

impl MidTerm {
    /// From lengths in samples, rounded as pyAudioAnalysis 0.3.14 does (halves to even).
    ///
    /// # Errors
    /// A step of less than half a short step, or no short step.
    pub fn from_samples(
        mid_window: usize,
        mid_step: usize,
        window: usize,
        step: usize,
    ) -> Result<Self> {
        if step == 0 {
            return Err(DspError::parameter("step", step, "at least 1"));
        }
        let frames = |samples: f64| (samples / step as f64).round_ties_even().max(0.0) as usize;
        let overlap = window as f64 - step as f64;
        let result =
            Self { window: frames(mid_window as f64 - overlap), step: frames(mid_step as f64) };
        if result.step == 0 {
            let allowed = format!("more than half of step ({step})");
            return Err(DspError::parameter("mid_step", mid_step, allowed));
        }
        if result.window == 0 {
            let allowed = format!("more than window - step / 2 ({window}, {step})");
            return Err(DspError::parameter("mid_window", mid_window, allowed));
        }
        Ok(result)
    }

    /// Means, then standard deviations (population) of `short [rows, frames]` over each window:
    /// `[2 * rows, windows]`.
    pub fn statistics(&self, short: ArrayView2<f64>) -> Array2<f64> {
        let (rows, frames) = short.dim();
        let count = frames.div_ceil(self.step);
        let mut out = Array2::zeros((2 * rows, count));
        for m in 0..count {
            let start = m * self.step;
            let part = short.slice(s![.., start..(start + self.window).min(frames)]);
            let n = part.ncols() as f64;
            for (r, row) in part.outer_iter().enumerate() {
                let mean = row.sum() / n;
                out[[r, m]] = mean;
                out[[rows + r, m]] =
                    (row.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
            }
        }
        out
    }
}

/// One vector for a recording: the mean over mid-term windows, 136 values for 68 rows.
pub fn file_vector(mid: ArrayView2<f64>) -> Array1<f64> {
    mid.mean_axis(Axis(1)).unwrap_or_else(|| Array1::zeros(mid.nrows()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_shrink_at_the_end() {
        let short = Array2::from_shape_fn((1, 5), |(_, t)| t as f64);
        let mid = MidTerm { window: 4, step: 2 }.statistics(short.view());
        assert_eq!(mid.dim(), (2, 3));
        assert_eq!(mid.row(0).to_vec(), [1.5, 3.0, 4.0]);
        assert_eq!(mid[[1, 2]], 0.0);
        assert!((file_vector(mid.view())[0] - 8.5 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn rounding() {
        let m = MidTerm::from_samples(44100, 11025, 2205, 1102).unwrap();
        assert_eq!(m, MidTerm { window: 39, step: 10 });
        assert!(MidTerm::from_samples(44100, 10, 2205, 2205).is_err());
    }
}
