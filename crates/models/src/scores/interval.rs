//! Intervals of scores by drawing rows, or whole groups, with replacement.

use std::collections::BTreeMap;

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

/// A 95 % percentile interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// lower end
    pub low: f64,
    /// upper end
    pub high: f64,
}

impl Interval {
    /// Of sorted scores.
    pub(crate) fn of(scores: &[f64]) -> Self {
        let at = |part: f64| {
            let place = (scores.len().saturating_sub(1) as f64 * part).round() as usize;
            scores.get(place).copied().unwrap_or(f64::NAN)
        };
        Self { low: at(0.025), high: at(0.975) }
    }
}

/// Rows that are drawn together: those of each group, or each row by itself.
pub(crate) fn units<S: AsRef<str>>(rows: usize, groups: Option<&[S]>) -> Vec<Vec<usize>> {
    let Some(groups) = groups else { return (0..rows).map(|row| vec![row]).collect() };
    let mut units: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    groups.iter().enumerate().for_each(|(row, g)| units.entry(g.as_ref()).or_default().push(row));
    units.into_values().collect()
}

/// The interval of each score of rows that are drawn with replacement, all those of a unit together, as many units as
/// there are.
pub fn intervals<const N: usize>(
    units: &[Vec<usize>],
    draws: usize,
    seed: u64,
    scores: impl Fn(&[usize]) -> [f64; N],
) -> [Interval; N] {
    drawn(units, draws, seed, scores).map(|all| Interval::of(&all))
}

/// The scores of the rows of each draw, from the least to the greatest.
pub(crate) fn drawn<const N: usize>(
    units: &[Vec<usize>],
    draws: usize,
    seed: u64,
    scores: impl Fn(&[usize]) -> [f64; N],
) -> [Vec<f64>; N] {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut found: [Vec<f64>; N] = std::array::from_fn(|_| Vec::with_capacity(draws.min(1 << 20)));
    let mut rows = Vec::new();
    for _ in 0..draws {
        rows.clear();
        for _ in 0..units.len() {
            rows.extend_from_slice(&units[rng.gen_range(0..units.len())]);
        }
        found.iter_mut().zip(scores(&rows)).for_each(|(all, score)| all.push(score));
    }
    found.iter_mut().for_each(|all| all.sort_by(f64::total_cmp));
    found
}
