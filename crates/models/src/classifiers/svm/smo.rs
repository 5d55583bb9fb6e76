//! Sequential minimal optimisation with second-order working set selection (Fan, Chen & Lin 2005)
//! for min ½αᵀQα − Σα, 0 ≤ αᵢ ≤ Cᵢ, yᵀα = 0, with Qᵢⱼ = yᵢyⱼK(i, j).

use super::kernel::{Gram, Precision, Rows};
use crate::error::{ModelError, Result};

/// The optimum: f(x) = Σ yᵢαᵢK(i, x) − ρ.
pub(super) struct Solution {
    pub alpha: Vec<f64>,
    pub rho: f64,
    /// whether single precision was not enough
    pub needs_double: bool,
}

/// Smallest curvature used, where the kernel matrix is not positive definite.
const TAU: f64 = 1e-12;

/// Steps after which the search is given up; scikit-learn has no such limit.
pub(super) const MOST_STEPS: usize = 100_000_000;

/// Steps after which single precision is given up.
const MOST_ROUNDED: usize = 10_000_000;
/// Single precision is given up once rounding may have moved the slopes by this many tolerances: double precision
/// would gain nothing from where it is then.
const ASTRAY: f64 = 10.0;

/// A two-class problem: y is 1 or -1, and no α goes beyond its bound.
pub(super) struct Problem<'a> {
    pub y: &'a [f64],
    pub bound: &'a [f64],
    pub tol: f64,
    pub most_steps: usize,
}

impl Problem<'_> {
    /// Searches with kernel values in single precision, then, where their rounding could be seen, from
    /// there in double precision.
    pub(super) fn solve(
        &self,
        gram: &Gram<'_>,
        rows: &[u32],
        cache_bytes: usize,
    ) -> Result<Solution> {
        let mut search = Search {
            problem: self,
            diagonal: rows.iter().map(|&row| gram.diagonal(row)).collect(),
            alpha: vec![0.0; rows.len()],
            slope: self.y.iter().map(|y| -y).collect(),
            steps: 0,
        };
        let mut is_optimum = search.go_on(&mut gram.rows::<f32>(rows, cache_bytes));
        let needs_double = !is_optimum || search.rounding() > self.tol;
        if needs_double {
            let mut exact = gram.rows::<f64>(rows, cache_bytes);
            search.correct(&mut exact);
            is_optimum = search.go_on(&mut exact);
        }
        let rho = search.state().rho(&search.slope);
        let reason = match is_optimum {
            _ if !rho.is_finite() => {
                "the optimisation overflowed: standardise the features first".into()
            }
            true => return Ok(Solution { alpha: search.alpha, rho, needs_double }),
            false => format!(
                "no optimum found after {} steps: standardise the features, lower C, or raise tol",
                search.steps
            ),
        };
        Err(ModelError::Numerical { owner: "svm", reason })
    }
}

struct Search<'a> {
    problem: &'a Problem<'a>,
    diagonal: Vec<f64>,
    alpha: Vec<f64>,
    /// y·gradient, so that no sign has to be looked up in the loops
    slope: Vec<f64>,
    steps: usize,
}

impl Search<'_> {
    fn state(&self) -> State<'_> {
        State { alpha: &self.alpha, y: self.problem.y, bound: self.problem.bound }
    }

    /// How far rounded kernel values may have moved the slopes: a few standard deviations.
    fn rounding(&self) -> f64 {
        let terms = self.alpha.iter().zip(&self.diagonal);
        let spread = terms.map(|(alpha, k)| alpha * alpha * k).sum::<f64>();
        let most = self.diagonal.iter().copied().fold(0.0, f64::max);
        2.0 * f64::from(f32::EPSILON) * (spread * most).sqrt()
    }

    /// Computes the slopes again.
    fn correct(&mut self, kernel: &mut Rows<'_, '_, f64>) {
        let y = self.problem.y;
        self.slope = y.iter().map(|y| -y).collect();
        for (i, &alpha) in self.alpha.iter().enumerate().filter(|(_, alpha)| **alpha > 0.0) {
            let row = kernel.one(i);
            self.slope.iter_mut().zip(row).for_each(|(s, &k)| *s += alpha * y[i] * k);
        }
    }

    /// Takes steps until the optimality conditions hold; false if it gives up, in single precision as soon as
    /// rounding outweighs `tol`.
    fn go_on<T: Precision>(&mut self, kernel: &mut Rows<'_, '_, T>) -> bool {
        /// Steps between two checks of the rounding.
        const LOOKS: usize = 1 << 12;
        let Problem { y, bound, tol, most_steps } = *self.problem;
        self.steps = 0;
        while self.steps < most_steps {
            if T::IS_ROUNDED && self.steps % LOOKS == LOOKS - 1 {
                let is_late = self.steps > MOST_ROUNDED;
                if is_late || self.rounding() > ASTRAY * tol {
                    return false;
                }
            }
            let Self { diagonal, alpha, slope, steps, .. } = self;
            *steps += 1;
            let state = State { alpha, y, bound };
            let partner = state.up(slope).and_then(|(i, steepest)| {
                let row = kernel.one(i);
                Some((i, state.down(slope, i, steepest, row, diagonal, tol)?))
            });
            let Some((i, j)) = partner else { return true };
            let (row_i, row_j) = kernel.two(i, j);
            let curvature = (diagonal[i] + diagonal[j] - 2.0 * row_i[j].into()).max(TAU);
            let (old_i, old_j) = (alpha[i], alpha[j]);
            // Along the line that keeps yᵀα: αᵢ += yᵢ·step, αⱼ −= yⱼ·step.
            let step = (slope[j] - slope[i]) / curvature;
            let room =
                |a: f64, y: f64, c: f64, forth: bool| if (y > 0.0) == forth { c - a } else { a };
            let room_i = room(old_i, y[i], bound[i], true);
            let room_j = room(old_j, y[j], bound[j], false);
            let step = step.min(room_i).min(room_j);
            // A bound that is reached is met exactly.
            alpha[i] = snap(old_i + y[i] * step, step == room_i, y[i] > 0.0, bound[i]);
            alpha[j] = snap(old_j - y[j] * step, step == room_j, y[j] < 0.0, bound[j]);
            let (change_i, change_j) = (y[i] * (alpha[i] - old_i), y[j] * (alpha[j] - old_j));
            if change_i == 0.0 && change_j == 0.0 {
                // Rounding hides the step, and every further one.
                return false;
            }
            for ((s, &ki), &kj) in slope.iter_mut().zip(row_i).zip(row_j) {
                *s += change_i * ki.into() + change_j * kj.into();
            }
        }
        false
    }
}

fn snap(value: f64, reached: bool, rising: bool, bound: f64) -> f64 {
    match (reached, rising) {
        (true, true) => bound,
        (true, false) => 0.0,
        _ => value,
    }
}

struct State<'a> {
    alpha: &'a [f64],
    y: &'a [f64],
    bound: &'a [f64],
}

impl State<'_> {
    /// Whether y·α of a row can still grow.
    fn can_rise(&self, t: usize) -> bool {
        if self.y[t] > 0.0 { self.alpha[t] < self.bound[t] } else { self.alpha[t] > 0.0 }
    }

    /// Whether y·α of a row can still shrink.
    fn can_fall(&self, t: usize) -> bool {
        if self.y[t] > 0.0 { self.alpha[t] > 0.0 } else { self.alpha[t] < self.bound[t] }
    }

    /// The row whose rise lowers the objective fastest, with −slope there.
    fn up(&self, slope: &[f64]) -> Option<(usize, f64)> {
        let mut best: Option<(usize, f64)> = None;
        for (t, &s) in slope.iter().enumerate() {
            if self.can_rise(t) && best.is_none_or(|(_, b)| -s >= b) {
                best = Some((t, -s));
            }
        }
        best
    }

    /// The partner that gains most to second order; `None` when the conditions hold within `tol`.
    fn down<T: Precision>(
        &self,
        slope: &[f64],
        i: usize,
        steepest: f64,
        row: &[T],
        diagonal: &[f64],
        tol: f64,
    ) -> Option<usize> {
        let mut lowest = f64::NEG_INFINITY;
        let mut best: Option<(usize, f64)> = None;
        for (t, &s) in slope.iter().enumerate() {
            if !self.can_fall(t) {
                continue;
            }
            lowest = lowest.max(s);
            let difference = steepest + s;
            if difference > 0.0 {
                let curvature = (diagonal[i] + diagonal[t] - 2.0 * row[t].into()).max(TAU);
                let gain = difference * difference / curvature;
                if best.is_none_or(|(_, b)| gain >= b) {
                    best = Some((t, gain));
                }
            }
        }
        best.filter(|_| steepest + lowest >= tol).map(|(t, _)| t)
    }

    /// Offset from the free rows, or midway between its bounds when there are none.
    fn rho(&self, slope: &[f64]) -> f64 {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let (mut sum, mut free) = (0.0, 0usize);
        for (t, &s) in slope.iter().enumerate() {
            match (self.can_rise(t), self.can_fall(t)) {
                (true, true) => {
                    sum += s;
                    free += 1;
                }
                (true, false) => high = high.min(s),
                (false, _) => low = low.max(s),
            }
        }
        if free > 0 { sum / free as f64 } else { (low + high) / 2.0 }
    }
}
