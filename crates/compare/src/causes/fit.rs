//! Straight lines from one array to the other: `b = slope * a + offset`, for the whole or for each
//! channel, coefficient or frame.

use ndarray::{Array3, ArrayViewD, ArrayViewMutD, Axis};

/// What is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Model {
    Offset,
    Ratio,
    Affine,
}

/// Values that share a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    /// All.
    Whole,
    /// Those of a channel.
    Channel,
    /// Those of a coefficient, in all channels.
    Coefficient,
    /// Those of a frame of one channel.
    Frame,
    /// Those of a coefficient of one channel.
    Series,
}

/// Lines that make one array of the other.
#[derive(Debug)]
pub(super) struct Fit {
    /// Slope and offset of each group.
    pub lines: Vec<[f64; 2]>,
    /// Share of the differing values that the lines explain.
    pub share: f64,
    group: Group,
}

/// Least share of the differing values that a fit must explain.
const EXPLAINED: f64 = 0.9;
/// Values looked at to find a line.
const SAMPLE: usize = 20_000;
/// Fewest values of a line.
const FEWEST: usize = 8;

/// Fits a model to each group and counts what that explains. Values at a floor (many equal minima)
/// are left out: a limit does not move with them.
pub(super) fn fit(
    a: &Array3<f64>,
    b: &Array3<f64>,
    noise: f64,
    group: Group,
    model: Model,
) -> Option<Fit> {
    let floors = [floor(a), floor(b)];
    let usable = |x: f64, y: f64| {
        x.is_finite() && y.is_finite() && floors[0] != Some(x) && floors[1] != Some(y)
    };
    let slices: Vec<_> = groups(a, group).into_iter().zip(groups(b, group)).collect();
    if group != Group::Whole && slices.len() < 2 {
        return None;
    }
    let fewest = if model == Model::Affine { 2 * FEWEST } else { FEWEST };
    if a.len() < fewest * slices.len() {
        return None;
    }
    let (mut lines, mut differing, mut fixed) = (Vec::with_capacity(slices.len()), 0u64, 0u64);
    for (x, y) in slices {
        let [slope, offset] = line(&sample(&x, &y, usable), model, noise);
        lines.push([slope, offset]);
        for (&x, &y) in x.iter().zip(&y).filter(|&(&x, &y)| usable(x, y)) {
            let differs = (x - y).abs() > noise;
            let holds = (slope * x + offset - y).abs() <= 2.0 * noise;
            // What was equal and is no longer counts against the fit.
            differing += u64::from(differs || !holds);
            fixed += u64::from(differs && holds);
        }
    }
    let share = fixed as f64 / differing.max(1) as f64;
    (share >= EXPLAINED && fixed >= FEWEST as u64).then_some(Fit { lines, share, group })
}

impl Fit {
    /// The line that changes nothing.
    pub(super) fn identity() -> Self {
        Self { lines: vec![[1.0, 0.0]], share: 1.0, group: Group::Whole }
    }

    /// The first array's values changed by the lines.
    pub(super) fn apply(&self, a: &Array3<f64>) -> Array3<f64> {
        let mut changed = a.clone();
        let views: Vec<ArrayViewMutD<'_, f64>> = match self.group {
            Group::Whole => vec![changed.view_mut().into_dyn()],
            Group::Channel => changed.axis_iter_mut(Axis(0)).map(|v| v.into_dyn()).collect(),
            Group::Coefficient => changed.axis_iter_mut(Axis(1)).map(|v| v.into_dyn()).collect(),
            Group::Frame => changed.lanes_mut(Axis(1)).into_iter().map(|v| v.into_dyn()).collect(),
            Group::Series => changed.lanes_mut(Axis(2)).into_iter().map(|v| v.into_dyn()).collect(),
        };
        for (mut view, [slope, offset]) in views.into_iter().zip(&self.lines) {
            view.mapv_inplace(|v| slope * v + offset);
        }
        changed
    }
}

fn groups(values: &Array3<f64>, group: Group) -> Vec<ArrayViewD<'_, f64>> {
    match group {
        Group::Whole => vec![values.view().into_dyn()],
        Group::Channel => values.axis_iter(Axis(0)).map(|v| v.into_dyn()).collect(),
        Group::Coefficient => values.axis_iter(Axis(1)).map(|v| v.into_dyn()).collect(),
        Group::Frame => values.lanes(Axis(1)).into_iter().map(|v| v.into_dyn()).collect(),
        Group::Series => values.lanes(Axis(2)).into_iter().map(|v| v.into_dyn()).collect(),
    }
}

/// The smallest value where at least a thousandth of the values, and three, have it.
fn floor(values: &Array3<f64>) -> Option<f64> {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let count = values.iter().filter(|&&v| v == least).count();
    (count >= 3 && count * 1000 >= values.len()).then_some(least)
}

fn sample(
    a: &ArrayViewD<'_, f64>,
    b: &ArrayViewD<'_, f64>,
    usable: impl Fn(f64, f64) -> bool,
) -> Vec<(f64, f64)> {
    // An odd step does not fall in with the length of an axis.
    let step = (a.len() / SAMPLE) | 1;
    let pairs = a.iter().zip(b).step_by(step).map(|(&x, &y)| (x, y));
    pairs.filter(|&(x, y)| usable(x, y)).collect()
}

/// The line through most of the points.
fn line(points: &[(f64, f64)], model: Model, noise: f64) -> [f64; 2] {
    match model {
        Model::Offset => [1.0, median(points.iter().map(|(a, b)| b - a)).unwrap_or(0.0)],
        Model::Ratio => {
            let largest = points.iter().fold(0.0f64, |most, (a, _)| most.max(a.abs()));
            let large = points.iter().filter(|(a, _)| a.abs() > 1e-2 * largest);
            [median(large.map(|(a, b)| b / a)).unwrap_or(1.0), 0.0]
        }
        Model::Affine => {
            let first = least_squares(points);
            // Once more without what does not lie near: edges, clamps.
            let off = |&(a, b): &(f64, f64)| (first[0] * a + first[1] - b).abs();
            let usual = median(points.iter().map(off)).unwrap_or(0.0);
            let near: Vec<(f64, f64)> =
                points.iter().copied().filter(|p| off(p) <= noise + 2.0 * usual).collect();
            least_squares(&near)
        }
    }
}

fn least_squares(points: &[(f64, f64)]) -> [f64; 2] {
    let count = points.len().max(1) as f64;
    let mean = points.iter().fold([0.0, 0.0], |m, (a, b)| [m[0] + a / count, m[1] + b / count]);
    let (mut squares, mut product) = (0.0, 0.0);
    for (a, b) in points {
        squares += (a - mean[0]) * (a - mean[0]);
        product += (a - mean[0]) * (b - mean[1]);
    }
    let slope = if squares > 0.0 { product / squares } else { 1.0 };
    [slope, mean[1] - slope * mean[0]]
}

/// The middle value; `None` of none.
pub(super) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
