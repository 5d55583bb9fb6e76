//! Uncertainty of a score by resampling.

use std::cell::Cell;

use corsmal_models::scores::intervals;

/// Resamples of each interval.
const RESAMPLES: usize = 1000;

/// The 95 % percentile interval of `score` over bootstrap samples: whole groups are drawn. `groups` are rows that belong
/// together; `score` takes the rows of a sample. None for fewer than two groups or where the score is not finite.
pub(super) fn bootstrap(
    groups: &[Vec<usize>],
    seed: u64,
    score: impl Fn(&[usize]) -> f64,
) -> Option<(f64, f64)> {
    if groups.len() < 2 {
        return None;
    }
    let is_finite = Cell::new(true);
    let [interval] = intervals(groups, RESAMPLES, seed, |rows| {
        let score = score(rows);
        is_finite.set(is_finite.get() && score.is_finite());
        [score]
    });
    is_finite.get().then_some((interval.low, interval.high))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Right with probability 0.8 in 400 rows: about 0.8 ± 1.96 sqrt(0.8 · 0.2 / 400).
    #[test]
    fn of_a_proportion_is_as_wide_as_theory_says() {
        let groups: Vec<Vec<usize>> = (0..400).map(|row| vec![row]).collect();
        let right = |rows: &[usize]| {
            rows.iter().filter(|row| *row % 5 != 0).count() as f64 / rows.len() as f64
        };
        let (low, high) = bootstrap(&groups, 1, right).unwrap();
        assert!((low - 0.761).abs() < 0.01 && (high - 0.839).abs() < 0.01, "{low} {high}");
        // Rows that stand and fall together tell less.
        let groups: Vec<Vec<usize>> = (0..20).map(|g| (g * 20..g * 20 + 20).collect()).collect();
        let by_group = |rows: &[usize]| {
            rows.iter().filter(|row| *row / 20 % 5 != 0).count() as f64 / rows.len() as f64
        };
        let (wide_low, wide_high) = bootstrap(&groups, 1, by_group).unwrap();
        assert!(wide_high - wide_low > 3.0 * (high - low));
        assert_eq!(bootstrap(&groups[..1], 1, right), None);
    }
}
