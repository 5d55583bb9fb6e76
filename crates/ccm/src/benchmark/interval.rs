//! Uncertainty of a score by resampling.

use rand::Rng;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// Resamples of each interval.
const RESAMPLES: usize = 1000;

/// The 95 % percentile interval of `score` over bootstrap samples: whole groups are drawn with
/// replacement, as many as there are. `groups` are rows that belong together; `score` takes the rows
/// of a sample. None for fewer than two groups or where the score is not finite.
pub(super) fn bootstrap(
    groups: &[Vec<usize>],
    seed: u64,
    score: impl Fn(&[usize]) -> f64,
) -> Option<(f64, f64)> {
    if groups.len() < 2 {
        return None;
    }
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut scores = Vec::with_capacity(RESAMPLES);
    let mut rows = Vec::new();
    for _ in 0..RESAMPLES {
        rows.clear();
        for _ in 0..groups.len() {
            rows.extend_from_slice(&groups[random.gen_range(0..groups.len())]);
        }
        scores.push(score(&rows));
    }
    if scores.iter().any(|s| !s.is_finite()) {
        return None;
    }
    scores.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| scores[(share * (RESAMPLES - 1) as f64).round() as usize];
    Some((at(0.025), at(0.975)))
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
