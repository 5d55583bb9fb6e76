//! Scores of estimated numbers, such as capacities and masses.

use serde::Serialize;

use super::interval::{Interval, intervals, units};
use crate::error::{ModelError, Result};

/// Scores of estimated against true numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NumericScores {
    /// rows
    pub rows: usize,
    /// rows without an estimate: they count in the paper's score, with 0, and in nothing else
    pub unknown: usize,
    /// mean absolute error
    pub mean_absolute_error: f64,
    /// root of the mean squared error
    pub root_mean_squared_error: f64,
    /// mean of |estimate − truth| / truth over rows with a true value other than 0
    pub mean_relative_error: f64,
    /// coefficient of determination (scikit-learn's `r2_score`)
    pub r2: f64,
    /// the paper's score: mean of exp(−|estimate − truth| / truth), the error being the estimate
    /// itself where the true value is 0; below -1 an estimate counts 0 unless a true number is negative
    pub score: f64,
    /// 95 % bootstrap interval of the paper's score
    pub score_interval: Interval,
    /// what was drawn for it: the name of a column, or `rows`
    pub drawn: String,
    /// how many of those there are
    pub units: usize,
    /// what makes the scores doubtful; left out of JSON if there is nothing
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// What stands for no estimate among `truth`: the benchmark's -1, unless a true number is negative, where -1 is a
/// number like any other.
pub fn no_estimate(truth: &[f64]) -> Option<f64> {
    truth.iter().all(|t| *t >= 0.0).then_some(-1.0)
}

impl NumericScores {
    /// Scores of `estimates` against `truth`, with intervals over rows or whole groups, which are called `drawn`.
    ///
    /// # Errors
    /// Different lengths, or no rows.
    pub fn new<S: AsRef<str>>(
        truth: &[f64],
        estimates: &[Option<f64>],
        (drawn, groups): (&str, Option<&[S]>),
        (draws, seed): (usize, u64),
    ) -> Result<Self> {
        let length = |what, expected, actual| Err(ModelError::Length { what, expected, actual });
        if estimates.len() != truth.len() {
            return length("estimates", truth.len(), estimates.len());
        }
        if let Some(groups) = groups.filter(|g| g.len() != truth.len()) {
            return length("groups", truth.len(), groups.len());
        }
        let pairs: Vec<(f64, f64)> =
            truth.iter().zip(estimates).filter_map(|(t, e)| e.map(|e| (*t, e))).collect();
        if pairs.is_empty() {
            return length("rows with an estimate", 1, 0);
        }
        let n = pairs.len() as f64;
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
        let centre = mean(&|(t, _)| *t);
        let squared = mean(&|(t, e)| (e - t).powi(2));
        let spread = mean(&|(t, _)| (t - centre).powi(2));
        let relative: Vec<f64> =
            pairs.iter().filter(|(t, _)| *t != 0.0).map(|(t, e)| ((e - t) / t).abs()).collect();
        let none = no_estimate(truth);
        let of_row = |row: usize| {
            let (t, Some(e)) = (truth[row], estimates[row]) else { return 0.0 };
            if none.is_some_and(|none| e <= none) {
                return 0.0;
            }
            let error = if t == 0.0 { e.abs() } else { ((e - t) / t).abs() };
            (-error).exp()
        };
        let score = |rows: &[usize]| {
            [rows.iter().map(|&row| of_row(row)).sum::<f64>() / rows.len().max(1) as f64]
        };
        let all: Vec<usize> = (0..truth.len()).collect();
        let units = units(truth.len(), groups);
        let [score_interval] = intervals(&units, draws, seed, score);
        Ok(Self {
            rows: truth.len(),
            unknown: truth.len() - pairs.len(),
            mean_absolute_error: mean(&|(t, e)| (e - t).abs()),
            root_mean_squared_error: squared.sqrt(),
            mean_relative_error: relative.iter().sum::<f64>() / relative.len().max(1) as f64,
            // The mean of equal numbers may be a bit beside them.
            r2: match spread > 0.0 && pairs.iter().any(|(t, _)| *t != pairs[0].0) {
                true => 1.0 - squared / spread,
                false => f64::from(squared == 0.0),
            },
            score: score(&all)[0],
            score_interval,
            drawn: drawn.into(),
            units: units.len(),
            warnings: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minus_one_is_no_estimate_only_among_numbers_that_are_not_negative() {
        assert_eq!(no_estimate(&[0.0, 3.0]), Some(-1.0));
        assert_eq!(no_estimate(&[-20.5, 3.0]), None);
    }

    /// They earned exp(-|estimate - truth| / truth), of which the benchmark knows nothing.
    #[test]
    fn estimates_below_minus_one_earn_nothing_in_the_score_of_the_paper() {
        let score = |truth: [f64; 2]| {
            let estimates = [Some(100.0), Some(-5.0)];
            let scores = NumericScores::new::<&str>(&truth, &estimates, ("rows", None), (0, 0));
            let scores = scores.unwrap();
            assert_eq!((scores.rows, scores.unknown), (2, 0));
            scores.score
        };
        assert_eq!(score([100.0, 50.0]), 0.5);
        assert_eq!(score([100.0, -5.0]), 1.0);
    }

    /// As scikit-learn's `r2_score`, but for rounding.
    #[test]
    fn a_constant_truth_is_determined_by_right_estimates_alone() {
        let r2 = |estimates: [f64; 2]| {
            let estimates = estimates.map(Some);
            NumericScores::new::<&str>(&[1.5, 1.5], &estimates, ("rows", None), (0, 0)).unwrap().r2
        };
        assert_eq!((r2([1.5, 1.5]), r2([1.5, 2.0])), (1.0, 0.0));
        // Their mean is a bit beside them: it was -8.7e31, as scikit-learn's is.
        let three = NumericScores::new::<&str>(
            &[0.1; 3],
            &[Some(0.2), Some(0.1), Some(0.3)],
            ("rows", None),
            (0, 0),
        );
        assert_eq!(three.unwrap().r2, 0.0);
    }
}
