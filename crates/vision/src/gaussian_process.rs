//! Regression by Gaussian processes with a squared-exponential kernel and white noise.

use linfa_linalg::cholesky::{Cholesky, CholeskyInplace, SolveCInplace};
use linfa_linalg::triangular::{SolveTriangularInplace, UPLO};
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
#[serde(try_from = "Numbers", into = "Numbers")]
pub struct GaussianProcess {
    numbers: Numbers,
    /// Cholesky factor of the covariance over the variance of the signal, which every prediction needs.
    factor: Array2<f64>,
}

/// What a process is written as.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
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
        let mut numbers = Numbers {
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
                let covariance = numbers.covariance(length, noise);
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
                    numbers.length = length;
                    numbers.signal = signal;
                    numbers.noise = noise * signal;
                    numbers.weights = solved.to_vec();
                }
            }
        }
        if numbers.weights.is_empty() {
            return Err(VisionError::Request("no covariance matrix could be factored".into()));
        }
        Self::try_from(numbers).map_err(VisionError::Request)
    }

    /// How many inputs it takes.
    pub fn inputs(&self) -> usize {
        self.numbers.centre.len()
    }

    /// Predicts the target of inputs.
    ///
    /// # Errors
    /// [`VisionError::Request`] when their number is not that of the training rows, or the prediction is not a
    /// number.
    pub fn predict(&self, inputs: &[f64]) -> Result<Normal> {
        let Numbers { centre, scale, mean, length, signal, noise, .. } = &self.numbers;
        if inputs.len() != centre.len() {
            return Err(VisionError::Request(format!(
                "{} inputs for a process of {}",
                inputs.len(),
                centre.len()
            )));
        }
        let at = standardised(inputs, centre, scale);
        let near = self.numbers.inputs.iter().map(|row| kernel(row, &at, *length));
        let near = Array1::from_iter(near);
        let sum: f64 = near.iter().zip(&self.numbers.weights).map(|(k, w)| k * w).sum();
        // With the factor L of the covariance, k' C^-1 k is the square of L^-1 k.
        let solved =
            self.factor.solve_triangular_into(near.insert_axis(Axis(1)), UPLO::Lower).map_err(
                |e| VisionError::Request(format!("a covariance matrix without solution: {e}")),
            )?;
        let explained: f64 = solved.iter().map(|v| v * v).sum();
        let variance = signal * (1.0 - explained).max(0.0) + noise;
        let found = Normal { mean: mean + sum, deviation: variance.sqrt() };
        if !(found.mean.is_finite() && found.deviation.is_finite()) {
            return Err(VisionError::Request(format!(
                "a Gaussian process predicts {} ± {}",
                found.mean, found.deviation
            )));
        }
        Ok(found)
    }
}

impl Numbers {
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
}

impl From<GaussianProcess> for Numbers {
    fn from(process: GaussianProcess) -> Self {
        process.numbers
    }
}

impl TryFrom<Numbers> for GaussianProcess {
    type Error = String;

    /// Checks what comes from a file before a matrix of it is made.
    fn try_from(numbers: Numbers) -> std::result::Result<Self, String> {
        let Numbers { centre, scale, mean, length, signal, noise, inputs, weights } = &numbers;
        let rows = inputs.len();
        if !(2..=MAX_ROWS).contains(&rows) || weights.len() != rows {
            return Err(format!(
                "a Gaussian process of {rows} rows and {} weights; expected equally many, 2 to {MAX_ROWS}",
                weights.len()
            ));
        }
        let width = centre.len();
        if width == 0 || scale.len() != width || inputs.iter().any(|row| row.len() != width) {
            return Err(format!(
                "a Gaussian process whose rows, means and scales are not all {width} numbers"
            ));
        }
        let are_possible = {
            let mut any = centre.iter().chain(inputs.iter().flatten()).chain(weights).chain([mean]);
            let mut positive = scale.iter().chain([length, signal]);
            any.all(|v| v.is_finite())
                && positive.all(|v| v.is_finite() && *v > 0.0)
                && noise.is_finite()
                && *noise >= 0.0
        };
        if !are_possible {
            return Err(
                "a Gaussian process with numbers that are not finite, or scales, a length or a signal that are \
                 not above 0"
                    .into(),
            );
        }
        let factor = numbers
            .covariance(*length, noise / signal)
            .cholesky_into()
            .map_err(|e| format!("a Gaussian process whose covariance cannot be factored: {e}"))?;
        Ok(Self { numbers, factor })
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
    use serde_json::json;

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
        let read: GaussianProcess = serde_json::from_str(&text).unwrap();
        assert_eq!(read.numbers, process.numbers);
        assert_eq!(read.predict(&[2.0, 7.0]).unwrap(), near);
    }

    #[test]
    fn impossible_numbers_in_a_file_are_refused() {
        let rows: Vec<Vec<f64>> = (0..4).map(|i| vec![f64::from(i)]).collect();
        let process = GaussianProcess::fit(&rows, &[1.0, 2.0, 3.0, 5.0]).unwrap();
        let sound = serde_json::to_value(&process).unwrap();
        let many = vec![vec![0.5]; MAX_ROWS + 1];
        let weights = vec![0.5; MAX_ROWS + 1];
        for (changes, part) in [
            (vec![("length", json!(0.0))], "not above 0"),
            (vec![("signal", json!(0.0))], "not above 0"),
            (vec![("signal", json!(-1.0))], "not above 0"),
            (vec![("noise", json!(-1e-3))], "not above 0"),
            (vec![("scale", json!([0.0]))], "not above 0"),
            (vec![("scale", json!([]))], "not all 1 numbers"),
            (vec![("inputs", json!([[1.0], [2.0], [3.0], [4.0, 5.0]]))], "not all 1 numbers"),
            (vec![("weights", json!([1.0]))], "4 rows and 1 weights"),
            (vec![("inputs", json!(many)), ("weights", json!(weights))], "2 to 4096"),
            (
                vec![("inputs", json!([[1.0], [1.0], [1.0], [1.0]])), ("noise", json!(0.0))],
                "factored",
            ),
        ] {
            let mut changed = sound.clone();
            for (key, value) in changes {
                changed[key] = value;
            }
            let error = serde_json::from_value::<GaussianProcess>(changed).unwrap_err().to_string();
            assert!(error.contains(part), "{part}: {error}");
        }
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
