//! Regression by Gaussian processes with a squared-exponential kernel and white noise.

use linfa_linalg::cholesky::{Cholesky, SolveCInplace};
use ndarray::{Array1, Array2, Axis};
use serde::{Deserialize, Serialize};

use crate::error::{Result, VisionError};

/// Length scales, in standard deviations of the inputs, among which the likelihood chooses.
const LENGTHS: [f64; 9] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0];
/// Variances of the noise over that of the signal.
const NOISES: [f64; 8] = [1e-6, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.5];
/// Largest number of examples: the matrix of their distances is held in memory.
const MAX_ROWS: usize = 4096;

/// A fitted process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaussianProcess {
    /// Mean of each input.
    centre: Vec<f64>,
    /// Standard deviation of each input.
    scale: Vec<f64>,
    /// Mean of the targets.
    mean: f64,
    /// Length scale, signal variance, noise variance.
    length: f64,
    signal: f64,
    noise: f64,
    /// Standardised inputs, one row an example.
    inputs: Vec<Vec<f64>>,
    /// Covariance matrix's inverse times the centred targets.
    weights: Vec<f64>,
}

/// A prediction with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    /// Mean.
    pub mean: f64,
    /// Standard deviation, noise included.
    pub deviation: f64,
}

impl GaussianProcess {
    /// Fits to rows of inputs and their targets; length scale and noise by the largest marginal
    /// likelihood among fixed candidates, the signal's variance in closed form.
    ///
    /// # Errors
    /// [`VisionError::Request`] for fewer than two rows, too many, unequal lengths, or values that are not
    /// finite.
    pub fn fit(rows: &[Vec<f64>], targets: &[f64]) -> Result<Self> {
        let width = rows.first().map_or(0, Vec::len);
        let finite = rows.iter().flatten().chain(targets).all(|v| v.is_finite());
        let sound =
            rows.len() == targets.len() && rows.iter().all(|r| r.len() == width) && width > 0;
        if !(2..=MAX_ROWS).contains(&rows.len()) || !sound || !finite {
            return Err(VisionError::Request(format!(
                "a Gaussian process needs 2 to {MAX_ROWS} rows of equally many finite numbers, and as \
                 many targets; there are {} rows and {} targets",
                rows.len(),
                targets.len()
            )));
        }
        let n = rows.len() as f64;
        let column = |c: usize| rows.iter().map(move |r| r[c]);
        let centre: Vec<f64> = (0..width).map(|c| column(c).sum::<f64>() / n).collect();
        let deviation = |c: usize| {
            let sum: f64 = column(c).map(|v| (v - centre[c]).powi(2)).sum();
            let deviation = (sum / n).sqrt();
            if deviation > 0.0 { deviation } else { 1.0 }
        };
        let scale: Vec<f64> = (0..width).map(deviation).collect();
        let mean = targets.iter().sum::<f64>() / n;
        let mut process = Self {
            inputs: rows.iter().map(|row| standardised(row, &centre, &scale)).collect(),
            centre,
            scale,
            mean,
            length: 1.0,
            signal: 1.0,
            noise: 0.0,
            weights: vec![],
        };
        let centred = Array1::from_iter(targets.iter().map(|t| t - mean));
        let mut best = f64::NEG_INFINITY;
        for length in LENGTHS {
            for noise in NOISES {
                // Covariance over the variance of the signal.
                let covariance = process.covariance(length, noise);
                let Ok(factor) = covariance.cholesky() else { continue };
                let mut solved = centred.clone().insert_axis(Axis(1));
                let mut matrix = covariance;
                if matrix.solvec_inplace(&mut solved).is_err() {
                    continue;
                }
                let solved = solved.column(0).to_owned();
                let signal = (centred.dot(&solved) / n).max(1e-12);
                let determinant: f64 = factor.diag().iter().map(|v| v.ln()).sum();
                let likelihood = -0.5 * n * signal.ln() - determinant;
                if likelihood > best {
                    best = likelihood;
                    process.length = length;
                    process.signal = signal;
                    process.noise = noise * signal;
                    process.weights = solved.to_vec();
                }
            }
        }
        if process.weights.is_empty() {
            return Err(VisionError::Request("no covariance matrix could be factored".into()));
        }
        Ok(process)
    }

    fn covariance(&self, length: f64, noise: f64) -> Array2<f64> {
        let n = self.inputs.len();
        let mut matrix = Array2::zeros((n, n));
        for i in 0..n {
            for j in 0..=i {
                let value = kernel(&self.inputs[i], &self.inputs[j], length);
                matrix[[i, j]] = value;
                matrix[[j, i]] = value;
            }
            matrix[[i, i]] += noise;
        }
        matrix
    }

    /// Predicts the target of inputs.
    ///
    /// # Errors
    /// [`VisionError::Request`] when their number is not that of the training rows.
    pub fn predict(&self, inputs: &[f64]) -> Result<Normal> {
        if inputs.len() != self.centre.len() || self.weights.len() != self.inputs.len() {
            return Err(VisionError::Request(format!(
                "{} inputs for a process of {}",
                inputs.len(),
                self.centre.len()
            )));
        }
        let at = standardised(inputs, &self.centre, &self.scale);
        let near = self.inputs.iter().map(|row| kernel(row, &at, self.length));
        let near = Array1::from_iter(near);
        let mean = self.mean + near.iter().zip(&self.weights).map(|(k, w)| k * w).sum::<f64>();
        let mut matrix = self.covariance(self.length, self.noise / self.signal);
        let mut solved = near.clone().insert_axis(Axis(1));
        let explained = match matrix.solvec_inplace(&mut solved) {
            Ok(solved) => near.dot(&solved.column(0)),
            Err(_) => 0.0,
        };
        let variance = self.signal * (1.0 - explained).max(0.0) + self.noise;
        Ok(Normal { mean, deviation: variance.sqrt() })
    }
}

fn standardised(row: &[f64], centre: &[f64], scale: &[f64]) -> Vec<f64> {
    row.iter().zip(centre).zip(scale).map(|((v, c), s)| (v - c) / s).collect()
}

fn kernel(a: &[f64], b: &[f64], length: f64) -> f64 {
    let squared: f64 = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum();
    (-0.5 * squared / (length * length)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_function_is_followed_and_doubted_far_away() {
        let rows: Vec<Vec<f64>> = (0..40).map(|i| vec![f64::from(i) / 10.0, 7.0]).collect();
        let targets: Vec<f64> = rows.iter().map(|r| r[0].sin() + 3.0).collect();
        let process = GaussianProcess::fit(&rows, &targets).unwrap();
        for x in [0.55, 1.23, 3.71] {
            let found = process.predict(&[x, 7.0]).unwrap();
            assert!((found.mean - x.sin() - 3.0).abs() < 1e-3, "{x}: {found:?}");
        }
        let (near, far) =
            (process.predict(&[2.0, 7.0]).unwrap(), process.predict(&[30.0, 7.0]).unwrap());
        assert!(far.deviation > 20.0 * near.deviation, "{near:?} {far:?}");
        let text = serde_json::to_string(&process).unwrap();
        assert_eq!(serde_json::from_str::<GaussianProcess>(&text).unwrap(), process);
    }

    #[test]
    fn noise_is_found_and_unusable_rows_are_refused() {
        let rows: Vec<Vec<f64>> = (0..60).map(|i| vec![f64::from(i % 3)]).collect();
        let noise = |i: usize| if i.is_multiple_of(2) { 0.1 } else { -0.1 };
        let targets: Vec<f64> = (0..60).map(|i| (i % 3) as f64 + noise(i / 3)).collect();
        let found = GaussianProcess::fit(&rows, &targets).unwrap().predict(&[1.0]).unwrap();
        assert!((found.mean - 1.0).abs() < 0.03, "{found:?}");
        assert!((0.07..0.14).contains(&found.deviation), "{found:?}");
        for (rows, targets) in [
            (vec![vec![1.0]], vec![1.0]),
            (vec![vec![1.0], vec![f64::NAN]], vec![1.0, 2.0]),
            (vec![vec![1.0], vec![1.0, 2.0]], vec![1.0, 2.0]),
            (vec![vec![1.0], vec![2.0]], vec![1.0]),
        ] {
            assert!(GaussianProcess::fit(&rows, &targets).is_err());
        }
    }
}
