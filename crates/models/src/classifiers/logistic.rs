//! Logistic regression: the softmax (two classes: the logistic function) of linear scores, with an
//! L2 penalty on the weights, the intercepts free. Same objective as scikit-learn 1.9.

use ndarray::{
    Array1, Array2, ArrayBase, ArrayView1, ArrayView2, ArrayViewMut1, Axis, Data, Dimension, s,
};
use serde::{Deserialize, Serialize};

use super::{Classify, Train};
use crate::error::{ModelError, Result};
use crate::lbfgs::{self, End};
use crate::params::{ClassWeight, Parameters, parameters};

parameters! {
    /// Parameters of logistic regression.
    #[allow(non_snake_case, reason = "C is its name everywhere")]
    LogisticParams, "logistic" {
        C: f64 = 1.0, "a positive number", "inverse of the penalty's strength";
        class_weight: ClassWeight = ClassWeight::Equal,
            "null, balanced, or one positive number per class in label order", "weight of each class";
        tol: f64 = 1e-8, "a positive number", "slope of the mean loss, or the loss itself, at which the search ends; if rounding or max_iter end it first, less than about 1e-10 may be left to gain";
        max_iter: usize = 10_000, "a whole number of at least 1", "most steps";
    }
    check(this) {
        Self::require(this.C.is_finite() && this.C > 0.0, "C", this.C)?;
        Self::require(this.class_weight.is_valid(), "class_weight", format!("{:?}", this.class_weight))?;
        Self::require(this.tol.is_finite() && this.tol > 0.0, "tol", this.tol)?;
        Self::require(this.max_iter >= 1, "max_iter", this.max_iter)
    }
}

/// Fitted weights.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Logistic {
    n_classes: usize,
    /// `[classes, features]`; one row (of the second class) when there are two classes
    weights: Array2<f64>,
    intercepts: Array1<f64>,
}

impl Train for LogisticParams {
    type Fitted = Logistic;
    const FEWEST_CLASSES: usize = 2;

    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Logistic> {
        self.solve(x, y, n_classes, None)
    }

    fn train_weighted(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: &[f64],
    ) -> Result<Logistic> {
        self.solve(x, y, n_classes, Some(weights))
    }
}

impl LogisticParams {
    fn solve(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<Logistic> {
        let outputs = if n_classes == 2 { 1 } else { n_classes };
        let per_class = self.class_weight.per_class_of(y, n_classes, weights)?;
        let mut row_weights: Vec<f64> = y.iter().map(|&c| per_class[c]).collect();
        if let Some(weights) = weights {
            row_weights.iter_mut().zip(weights).for_each(|(row, weight)| *row *= weight);
        }
        // Sums of weights of any size stay within range.
        let heaviest = row_weights.iter().copied().fold(0.0, f64::max);
        row_weights.iter_mut().for_each(|weight| *weight /= heaviest);
        let total: f64 = row_weights.iter().sum();
        let penalty = 1.0 / self.C / heaviest / total;
        if !(total.is_finite() && penalty.is_finite()) {
            return Err(ModelError::Numerical {
                owner: Self::OWNER,
                reason: "C or the weights of the rows are too small".into(),
            });
        }
        let scale = Scale::of(x, &row_weights, penalty).ok_or_else(too_large)?;
        let z = scale.rows(x);
        let penalties = scale.deviations.mapv(|d| penalty / d / d);
        let objective = Objective { z, y, row_weights, total, penalties, outputs };
        let start = Array1::zeros(outputs * (x.ncols() + 1));
        let units = scale.deviations.mapv(|d| if d.is_finite() { d } else { 0.0 });
        let own = |gradient: ArrayView1<'_, f64>| {
            largest(&(&objective.table(gradient).slice(s![.., ..x.ncols()]) * &units))
        };
        // In either unit: large features make their own the finer one, small features the other.
        let slope = |gradient: ArrayView1<'_, f64>| own(gradient).max(largest(&gradient));
        let stopping = lbfgs::Stopping { slope, tol: self.tol, max_iter: self.max_iter };
        let found = lbfgs::minimise(start, &stopping, |at, gradient| objective.at(at, gradient));
        let left = slope(found.gradient.view());
        // Where features are large, rounding alone makes slopes by their weights.
        let gain = objective.gain(found.x.view(), found.gradient.view());
        let weights = scale.unscaled(objective.table(found.x.view()).to_owned());
        if !weights.iter().all(|v| v.is_finite()) {
            return Err(too_large());
        }
        let is_near = gain <= ROUNDING;
        if found.end != End::Converged && !is_near {
            let advice = match found.end {
                End::OutOfSteps => "standardise the features, or raise max_iter or tol",
                _ => "standardise the features, or raise tol",
            };
            let (steps, tol) = (found.steps, self.tol);
            return Err(ModelError::Numerical {
                owner: Self::OWNER,
                reason: format!(
                    "no minimum found: the largest slope is {left:.1e} after {steps} steps, tol is \
                     {tol:.0e}; {advice}"
                ),
            });
        }
        Ok(Logistic {
            n_classes,
            weights: weights.slice(s![.., ..x.ncols()]).to_owned(),
            intercepts: weights.column(x.ncols()).to_owned(),
        })
    }
}

/// What rounding may leave to gain.
const ROUNDING: f64 = 1e-10;
/// Shares of the weight of all rows below the values that make a feature's scale: those of a normal distribution's
/// deviations, and a middle that is not just between two rows of equal weight, so that rounding has no say.
const LOW: f64 = 0.1587;
const MIDDLE: f64 = 0.4991;
const HIGH: f64 = 0.8413;

/// Coordinates in which every feature matters alike, so that the search needs few steps whatever the features'
/// units: weights times `deviations`, the intercept where features are `centres`. A few wild rows have no say.
struct Scale {
    /// medians, nearly
    centres: Array1<f64>,
    /// half of what two thirds of the rows span; infinite for a constant feature, whose weight stays zero
    deviations: Array1<f64>,
}

impl Scale {
    /// `None` when features are too large for their squares.
    fn of(x: ArrayView2<'_, f64>, row_weights: &[f64], penalty: f64) -> Option<Self> {
        let (mut centres, mut deviations) = (Vec::new(), Vec::new());
        for column in x.columns() {
            let some = column.iter().copied().zip(row_weights.iter().copied());
            let mut some: Vec<(f64, f64)> = some.filter(|(_, weight)| *weight > 0.0).collect();
            some.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            let total: f64 = some.iter().map(|(_, weight)| weight).sum();
            let (mut centre, mut low, mut high) =
                (some.first()?.0, some.first()?.0, some.last()?.0);
            let mut before = 0.0;
            for (value, weight) in &some {
                let within = |share: f64| (before..before + weight).contains(&(share * total));
                low = if within(LOW) { *value } else { low };
                centre = if within(MIDDLE) { *value } else { centre };
                high = if within(HIGH) { *value } else { high };
                before += weight;
            }
            let mut deviation = (high - low) / 2.0;
            if deviation == 0.0 {
                let squares = some.iter().map(|(v, weight)| weight / total * (v - centre).powi(2));
                deviation = squares.sum::<f64>().sqrt();
            }
            if !(deviation * deviation).is_finite() {
                return None;
            }
            centres.push(centre);
            // The penalty bends the loss as data of this deviation would.
            deviations.push(match deviation > 0.0 {
                true => deviation.hypot(2.0 * penalty.sqrt()),
                false => f64::INFINITY,
            });
        }
        Some(Self { centres: centres.into(), deviations: deviations.into() })
    }

    fn rows(&self, x: ArrayView2<'_, f64>) -> Array2<f64> {
        (&x - &self.centres) / &self.deviations
    }

    /// `[outputs, features + 1]` in the coordinates of the features.
    fn unscaled(&self, mut table: Array2<f64>) -> Array2<f64> {
        for mut row in table.rows_mut() {
            let (mut weights, mut intercept) = row.view_mut().split_at(Axis(0), self.centres.len());
            weights /= &self.deviations;
            intercept[0] -= weights.dot(&self.centres);
        }
        table
    }
}

/// Mean loss plus penalty, as a function of `[outputs, features + 1]` (intercept last).
struct Objective<'y> {
    z: Array2<f64>,
    y: &'y [usize],
    row_weights: Vec<f64>,
    total: f64,
    /// of the square of each feature's weights
    penalties: Array1<f64>,
    outputs: usize,
}

impl Objective<'_> {
    fn table<'t>(&self, flat: ArrayView1<'t, f64>) -> ArrayView2<'t, f64> {
        let shape = (self.outputs, self.z.ncols() + 1);
        flat.into_shape_with_order(shape).expect("the shape minimised over")
    }

    fn at(&self, at: ArrayView1<'_, f64>, mut gradient: ArrayViewMut1<'_, f64>) -> f64 {
        let features = self.z.ncols();
        let table = self.table(at);
        let weights = table.slice(s![.., ..features]);
        let mut scores = self.z.dot(&weights.t()) + table.column(features);
        let mut loss = 0.0;
        for ((mut row, &class), weight) in
            scores.outer_iter_mut().zip(self.y).zip(&self.row_weights)
        {
            // The row of scores becomes the row of slopes.
            loss += weight * slopes(row.view_mut(), class);
            row *= weight / self.total;
        }
        let penalised = &weights * &self.penalties;
        let mut slope = Array2::zeros((self.outputs, features + 1));
        slope.slice_mut(s![.., ..features]).assign(&(scores.t().dot(&self.z) + &penalised));
        slope.column_mut(features).assign(&scores.sum_axis(Axis(0)));
        gradient.iter_mut().zip(&slope).for_each(|(to, &from)| *to = from);
        loss / self.total + 0.5 * (&penalised * &weights).sum()
    }
}

impl Objective<'_> {
    /// What a Newton step by each number alone would gain, all together: whatever the units of the features are.
    fn gain(&self, at: ArrayView1<'_, f64>, gradient: ArrayView1<'_, f64>) -> f64 {
        let features = self.z.ncols();
        let table = self.table(at);
        let mut bends = self.z.dot(&table.slice(s![.., ..features]).t()) + table.column(features);
        for (mut row, weight) in bends.outer_iter_mut().zip(&self.row_weights) {
            match row.len() {
                1 => row.mapv_inplace(logistic),
                _ => _ = soften(row.view_mut()),
            }
            row.mapv_inplace(|p| weight / self.total * p * (1.0 - p));
        }
        let by_weights = bends.t().dot(&self.z.mapv(|v| v * v)) + &self.penalties;
        let by_intercepts = bends.sum_axis(Axis(0));
        let gradient = self.table(gradient);
        let gain =
            |slope: &f64, bend: &f64| if *slope == 0.0 { 0.0 } else { slope * slope / bend / 2.0 };
        let weights = gradient.slice(s![.., ..features]);
        let of_weights = weights.iter().zip(&by_weights).map(|(g, h)| gain(g, h));
        let of_intercepts = gradient.column(features).into_iter().zip(&by_intercepts);
        of_weights.chain(of_intercepts.map(|(g, h)| gain(g, h))).sum()
    }
}

/// The largest size among numbers; what is not a number wins.
fn largest<D: Dimension>(values: &ArrayBase<impl Data<Elem = f64>, D>) -> f64 {
    let larger = |most: f64, v: &f64| if v.abs() > most || v.is_nan() { v.abs() } else { most };
    values.iter().fold(0.0, larger)
}

/// Loss of one row; its scores are replaced by the loss's derivatives.
fn slopes(mut scores: ArrayViewMut1<'_, f64>, class: usize) -> f64 {
    if scores.len() == 1 {
        let z = scores[0];
        let target = class as f64;
        scores[0] = logistic(z) - target;
        let tail = (-z.abs()).exp().ln_1p();
        return z.max(0.0) + tail - target * z;
    }
    let own = scores[class];
    let (top, sum) = soften(scores.view_mut());
    scores[class] -= 1.0;
    top + sum.ln() - own
}

fn logistic(z: f64) -> f64 {
    if z >= 0.0 { 1.0 / (1.0 + (-z).exp()) } else { z.exp() / (1.0 + z.exp()) }
}

/// Scores to softmax; gives the largest score and the sum of exponentials relative to it.
fn soften(mut scores: ArrayViewMut1<'_, f64>) -> (f64, f64) {
    let top = scores.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
    scores.mapv_inplace(|v| (v - top).exp());
    let sum = scores.sum();
    scores /= sum;
    (top, sum)
}

fn too_large() -> ModelError {
    ModelError::Numerical {
        owner: LogisticParams::OWNER,
        reason: "the weights overflowed: standardise the features first".into(),
    }
}

fn overflow() -> ModelError {
    ModelError::Numerical {
        owner: LogisticParams::OWNER,
        reason: "the scores overflowed: features too large".into(),
    }
}

impl Logistic {
    /// Linear scores `[rows, classes]`; `[rows, 1]` of two classes.
    fn scores(&self, x: ArrayView2<'_, f64>) -> Array2<f64> {
        x.dot(&self.weights.t()) + &self.intercepts
    }
}

impl Classify for Logistic {
    fn n_features(&self) -> usize {
        self.weights.ncols()
    }

    fn n_classes(&self) -> usize {
        self.n_classes
    }

    fn decision_function(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let scores = self.scores(x);
        if scores.iter().all(|v| v.is_finite()) { Ok(scores) } else { Err(overflow()) }
    }

    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let mut scores = self.scores(x);
        if self.n_classes == 2 {
            let second = scores.column(0).mapv(logistic);
            let mut proba = Array2::zeros((x.nrows(), 2));
            proba.column_mut(0).assign(&second.mapv(|p| 1.0 - p));
            proba.column_mut(1).assign(&second);
            return Ok(proba);
        }
        for row in scores.outer_iter_mut() {
            soften(row);
        }
        match scores.iter().all(|v| v.is_finite()) {
            true => Ok(scores),
            false => Err(overflow()),
        }
    }

    fn validate(&self) -> Result<()> {
        let outputs = if self.n_classes == 2 { 1 } else { self.n_classes };
        let sound = self.n_classes >= 2
            && self.weights.nrows() == outputs
            && self.intercepts.len() == outputs
            && self.weights.iter().chain(&self.intercepts).all(|v| v.is_finite());
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("weights".into())) }
    }
}
