//! Limited-memory BFGS (Nocedal & Wright, algorithms 7.4, 7.5, 3.5 and 3.6) for smooth functions.

use std::collections::VecDeque;

use ndarray::{Array1, ArrayView1, ArrayViewMut1};

/// When to stop.
pub(crate) struct Stopping<S> {
    /// how far a gradient is from that of a minimum
    pub slope: S,
    /// the slope, or the value, that is near enough
    pub tol: f64,
    /// most steps
    pub max_iter: usize,
}

/// Why the search stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    /// the slope is near enough
    Converged,
    /// rounding hides what further steps would gain
    Stalled,
    /// after the most steps
    OutOfSteps,
}

/// Where the search stopped.
pub(crate) struct Minimum {
    pub x: Array1<f64>,
    pub gradient: Array1<f64>,
    pub end: End,
    /// steps taken
    pub steps: usize,
}

/// Pairs of steps and gradient changes remembered.
const MEMORY: usize = 10;
const SUFFICIENT: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// Steps in a row that gain no more than rounding.
const STALLED: usize = 5;

/// Minimises `f`, which returns the value, at least 0, and writes the gradient.
pub(crate) fn minimise(
    start: Array1<f64>,
    stopping: &Stopping<impl Fn(ArrayView1<'_, f64>) -> f64>,
    mut f: impl FnMut(ArrayView1<'_, f64>, ArrayViewMut1<'_, f64>) -> f64,
) -> Minimum {
    let mut evaluate = |x: Array1<f64>| {
        let mut gradient = Array1::zeros(x.len());
        let value = f(x.view(), gradient.view_mut());
        Point { x, value, gradient }
    };
    let mut now = evaluate(start);
    let mut memory: VecDeque<(Array1<f64>, Array1<f64>)> = VecDeque::with_capacity(MEMORY);
    let (mut steps, mut idle) = (0, 0);
    let end = loop {
        // Nothing is below zero, so that no more than the value is left to gain.
        if now.value <= stopping.tol || (stopping.slope)(now.gradient.view()) <= stopping.tol {
            break End::Converged;
        }
        if idle == STALLED {
            break End::Stalled;
        }
        if steps == stopping.max_iter {
            break End::OutOfSteps;
        }
        let mut direction = towards(&now.gradient, &memory);
        if direction.dot(&now.gradient) >= 0.0 {
            memory.clear();
            direction = -&now.gradient;
        }
        let length = now.gradient.dot(&now.gradient).sqrt();
        let first = if memory.is_empty() { (1.0 / length).min(1.0) } else { 1.0 };
        let Some(next) = line_search(&now, &direction, first, &mut evaluate) else {
            break End::Stalled;
        };
        let gained = now.value - next.value > f64::EPSILON * now.value.abs();
        idle = if gained { 0 } else { idle + 1 };
        let (step, change) = (&next.x - &now.x, &next.gradient - &now.gradient);
        if step.dot(&change) > f64::EPSILON * change.dot(&change) {
            if memory.len() == MEMORY {
                memory.pop_front();
            }
            memory.push_back((step, change));
        }
        now = next;
        steps += 1;
    };
    Minimum { x: now.x, gradient: now.gradient, end, steps }
}

struct Point {
    x: Array1<f64>,
    value: f64,
    gradient: Array1<f64>,
}

/// −H·gradient by the two-loop recursion.
fn towards(gradient: &Array1<f64>, memory: &VecDeque<(Array1<f64>, Array1<f64>)>) -> Array1<f64> {
    let mut q = -gradient;
    let mut factors = Vec::with_capacity(memory.len());
    for (step, change) in memory.iter().rev() {
        let factor = step.dot(&q) / step.dot(change);
        q.scaled_add(-factor, change);
        factors.push(factor);
    }
    if let Some((step, change)) = memory.back() {
        q *= step.dot(change) / change.dot(change);
    }
    for ((step, change), factor) in memory.iter().zip(factors.into_iter().rev()) {
        let correction = factor - change.dot(&q) / step.dot(change);
        q.scaled_add(correction, step);
    }
    q
}

/// A point that meets the strong Wolfe conditions, by bracketing and bisection; the best that was
/// seen when none is found, `None` when nothing lowers the value.
fn line_search(
    from: &Point,
    direction: &Array1<f64>,
    first: f64,
    evaluate: &mut impl FnMut(Array1<f64>) -> Point,
) -> Option<Point> {
    let slope = from.gradient.dot(direction);
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let mut step = first;
    let mut best: Option<Point> = None;
    for _ in 0..40 {
        let point = evaluate(&from.x + &(direction * step));
        let here = point.gradient.dot(direction);
        let lowered = point.value <= from.value + SUFFICIENT * step * slope;
        if lowered && here.abs() <= -CURVATURE * slope {
            return Some(point);
        }
        if !lowered || here > 0.0 || !point.value.is_finite() {
            high = step;
        } else {
            low = step;
        }
        let limit = best.as_ref().map_or(from.value, |b| b.value);
        if point.value < limit {
            best = Some(point);
        }
        step = if high.is_finite() { (low + high) / 2.0 } else { 2.0 * step };
    }
    best
}
