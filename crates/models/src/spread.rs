//! Mean, spread and confidence interval of a score over folds.

use serde::Serialize;

/// Summary of one score over folds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// mean over folds
    pub mean: f64,
    /// standard deviation (divisor folds − 1); 0 for one fold
    pub std: f64,
    /// lower end of the 95 % interval of the mean by Student's t, within 0 to 1 where the values are;
    /// the mean itself for one fold
    pub low: f64,
    /// its upper end
    pub high: f64,
}

impl Spread {
    /// Summary of these values; all zero without any.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len();
        if n == 0 {
            return Self { mean: 0.0, std: 0.0, low: 0.0, high: 0.0 };
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        if n == 1 {
            return Self { mean, std: 0.0, low: mean, high: mean };
        }
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let std = (squares / (n - 1) as f64).sqrt();
        let half = student_975(n - 1) * std / (n as f64).sqrt();
        let (mut low, mut high) = (mean - half, mean + half);
        if values.iter().all(|v| (0.0..=1.0).contains(v)) {
            (low, high) = (low.max(0.0), high.min(1.0));
        }
        Self { mean, std, low, high }
    }
}

/// The 0.975 quantile of Student's t, by bisection of its distribution function.
fn student_975(degrees: usize) -> f64 {
    let (mut low, mut high) = (0.0, 13.0);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if central(middle, degrees) < 0.95 {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low + high) / 2.0
}

/// P(|T| ≤ t) for a whole number of degrees (Abramowitz & Stegun 26.7.3 and 26.7.4).
fn central(t: f64, degrees: usize) -> f64 {
    let theta = (t / (degrees as f64).sqrt()).atan();
    let (sin, cos2) = (theta.sin(), theta.cos().powi(2));
    let odd = degrees % 2 == 1;
    let mut term = if odd { theta.cos() } else { 1.0 };
    let mut sum = if degrees == 1 { 0.0 } else { term };
    let mut k = if odd { 3 } else { 2 };
    while k < degrees {
        term *= cos2 * (k - 1) as f64 / k as f64;
        sum += term;
        k += 2;
    }
    if odd { (theta + sin * sum) * std::f64::consts::FRAC_2_PI } else { sin * sum }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // scipy.stats.t.ppf(0.975, df)
        for (degrees, expected) in [
            (1, 12.706_204_7),
            (2, 4.302_652_7),
            (3, 3.182_446_3),
            (4, 2.776_445_1),
            (9, 2.262_157_2),
        ] {
            assert!((student_975(degrees) - expected).abs() < 1e-6, "{degrees}");
        }
        let spread = Spread::of(&[0.9, 0.8, 1.0]);
        assert!((spread.mean - 0.9).abs() < 1e-12 && (spread.std - 0.1).abs() < 1e-12);
        assert!((spread.low - 0.9 + 4.302_652_7 * 0.1 / 3f64.sqrt()).abs() < 1e-6);
        assert_eq!(spread.high, 1.0, "no share is above 1");
        let percent = Spread::of(&[90.0, 80.0, 100.0]);
        assert!((percent.high - 90.0 - 4.302_652_7 * 10.0 / 3f64.sqrt()).abs() < 1e-4);
    }
}
