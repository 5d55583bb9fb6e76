//! A two-class problem on rows of the training table.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::kernel::{Gram, Precision};
use super::smo;
use crate::error::Result;

/// A two-class problem on rows of the training table.
pub(super) struct TwoClass<'a, 'x> {
    pub(super) gram: &'a Gram<'x>,
    /// training rows
    pub(super) rows: Vec<u32>,
    /// +1 or −1
    pub(super) signs: Vec<f64>,
    /// largest α of each row
    pub(super) bounds: Vec<f64>,
    pub(super) tol: f64,
    pub(super) most_steps: usize,
    pub(super) cache_bytes: usize,
}

impl TwoClass<'_, '_> {
    /// The machine.
    pub(super) fn solve(&self) -> Result<smo::Solution> {
        let problem = smo::Problem {
            y: &self.signs,
            bound: &self.bounds,
            tol: self.tol,
            most_steps: self.most_steps,
        };
        problem.solve(self.gram, &self.rows, self.cache_bytes)
    }

    /// The problem restricted to some of its rows.
    fn subset(&self, keep: &[usize]) -> Self {
        Self {
            gram: self.gram,
            rows: keep.iter().map(|&i| self.rows[i]).collect(),
            signs: keep.iter().map(|&i| self.signs[i]).collect(),
            bounds: keep.iter().map(|&i| self.bounds[i]).collect(),
            tol: self.tol,
            most_steps: self.most_steps,
            cache_bytes: self.cache_bytes,
        }
    }

    /// The decision values of rows by the machine of other rows, before its offset.
    fn sums<T: Precision>(
        &self,
        rows: &[usize],
        inner: &Self,
        solution: &smo::Solution,
    ) -> Vec<f64> {
        let mut values = vec![T::default(); inner.rows.len()];
        let sum = |&row: &usize| {
            self.gram.fill(self.rows[row], &inner.rows, &mut values);
            let terms = values.iter().zip(&solution.alpha).zip(&inner.signs);
            terms.map(|((&k, a), s)| k.into() * a * s).sum()
        };
        rows.iter().map(sum).collect()
    }

    /// Decision values of all rows, each from a machine that has not seen it (five folds).
    pub(super) fn held_out_decisions(&self, seed: u64) -> Result<Vec<f64>> {
        const FOLDS: usize = 5;
        let n = self.rows.len();
        let mut order: Vec<usize> = (0..n).collect();
        order.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(seed));
        let mut decisions = vec![0.0; n];
        for fold in 0..FOLDS {
            let (start, end) = (fold * n / FOLDS, (fold + 1) * n / FOLDS);
            let held = &order[start..end];
            let kept: Vec<usize> = order[..start].iter().chain(&order[end..]).copied().collect();
            let inner = self.subset(&kept);
            let positive = inner.signs.iter().filter(|&&s| s > 0.0).count();
            if positive == 0 || positive == kept.len() {
                // As LIBSVM: one class alone wins everywhere.
                let value = f64::from(i8::from(positive > 0) - i8::from(positive < kept.len()));
                held.iter().for_each(|&i| decisions[i] = value);
                continue;
            }
            let solution = inner.solve()?;
            let sums = match solution.needs_double {
                true => self.sums::<f64>(held, &inner, &solution),
                false => self.sums::<f32>(held, &inner, &solution),
            };
            held.iter().zip(sums).for_each(|(&i, sum)| decisions[i] = sum - solution.rho);
        }
        Ok(decisions)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::super::kernel::Function;
    use super::*;

    /// Numbers from -1 to 1.
    fn noise(seed: u32) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        }
    }

    /// All rows of a table, whose errors cost alike.
    fn problem<'a, 'x>(
        gram: &'a Gram<'x>,
        signs: Vec<f64>,
        cost: f64,
        most_steps: usize,
    ) -> TwoClass<'a, 'x> {
        TwoClass {
            gram,
            rows: (0..signs.len() as u32).collect(),
            bounds: vec![cost; signs.len()],
            signs,
            tol: 1e-3,
            most_steps,
            cache_bytes: 1 << 20,
        }
    }

    /// Machines that were no optimum yet were taken for it.
    #[test]
    fn too_few_steps_are_an_error() {
        let x = Array2::from_shape_fn((20, 3), |(i, j)| ((i * 7 + j * 5) % 11) as f64);
        let gram = Gram::new(x.view(), Function::Linear, 1 << 20).unwrap();
        let solved = |most_steps| {
            let signs = (0..20).map(|i| if i % 3 == 0 { 1.0 } else { -1.0 }).collect();
            problem(&gram, signs, 1.0, most_steps).solve().map(|_| ())
        };
        assert!(solved(smo::MOST_STEPS).is_ok());
        let refused = solved(5).unwrap_err().to_string();
        assert!(refused.contains("no optimum found after 5 steps"), "{refused}");
    }

    /// Rows that single precision hardly tells apart: it never came to an end on them, double precision needs a few
    /// hundred steps.
    #[test]
    fn rows_that_single_precision_confuses_are_told_apart() {
        let mut noise = noise(7);
        let half = Array2::from_shape_simple_fn((20, 6), || 1e4 * noise());
        let beside = half.mapv(|v| v + 0.1 * noise());
        let x = ndarray::concatenate![ndarray::Axis(0), half, beside];
        let gram = Gram::new(x.view(), Function::Linear, 1 << 20).unwrap();
        let signs = (0..40).map(|i| if i < 20 { 1.0 } else { -1.0 }).collect();
        assert!(problem(&gram, signs, 1.0, 100_000).solve().is_ok());
    }

    /// With kernel values in single precision, as scikit-learn has them, the primal objective ended a tenth above
    /// the dual one.
    #[test]
    fn costly_errors_are_weighed_exactly() {
        let mut noise = noise(1);
        let (n, cost) = (40, 1e2);
        let x = Array2::from_shape_simple_fn((n, 4), || 100.0 + 30.0 * noise());
        let gram = Gram::new(x.view(), Function::Linear, 1 << 20).unwrap();
        let sign = |i| if x[[i, 0]] + 20.0 * noise() > 100.0 { 1.0 } else { -1.0 };
        let signs: Vec<f64> = (0..n).map(sign).collect();
        let problem = problem(&gram, signs, cost, smo::MOST_STEPS);
        let solution = problem.solve().unwrap();
        let terms: Vec<f64> =
            solution.alpha.iter().zip(&problem.signs).map(|(a, s)| a * s).collect();
        let normal = x.t().dot(&ndarray::aview1(&terms));
        let half = 0.5 * normal.dot(&normal);
        let margins = x.dot(&normal);
        let slack = margins
            .iter()
            .zip(&problem.signs)
            .map(|(m, s)| (1.0 - s * (m - solution.rho)).max(0.0));
        let primal = half + cost * slack.sum::<f64>();
        let dual = solution.alpha.iter().sum::<f64>() - half;
        assert!(primal - dual < 1e-3 * dual, "{primal} and {dual}");
    }
}
