//! Two arrays whose values stand in the same places.

use ndarray::{Array3, ArrayD, Axis, s};

/// What the three axes of a pair mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axes {
    /// Channel, coefficient, frame.
    Frames,
    /// One, column, row.
    Table,
}

impl Axes {
    /// The word for one place along an axis.
    pub(super) fn word(self, axis: usize) -> &'static str {
        match (self, axis) {
            (Self::Frames, 0) => "channel",
            (Self::Frames, 1) => "coefficient",
            (Self::Frames, _) => "frame",
            (Self::Table, 1) => "column",
            (Self::Table, _) => "row",
        }
    }
}

/// Two arrays of one shape.
#[derive(Debug)]
pub(super) struct Pair {
    /// Values of the first file.
    pub a: Array3<f64>,
    /// Values of the second.
    pub b: Array3<f64>,
    /// Meaning of the axes.
    pub axes: Axes,
}

/// Share of the largest magnitude below which differences are taken for rounding when causes are
/// looked for.
const NOISE: f64 = 1e-5;

impl Pair {
    /// Pairs two arrays; leading axes of length one are not counted. Gives them back where their
    /// shapes differ.
    pub(super) fn new(a: ArrayD<f64>, b: ArrayD<f64>) -> Result<Self, Box<[ArrayD<f64>; 2]>> {
        if trimmed(a.shape()) != trimmed(b.shape()) {
            return Err(Box::new([a, b]));
        }
        Ok(Self { a: cube(a), b: cube(b), axes: Axes::Frames })
    }

    /// The largest finite magnitude of both.
    pub(super) fn largest(&self) -> f64 {
        largest(self.a.iter().chain(&self.b))
    }

    /// Differences up to here are noise, relative to the second file's values.
    pub(super) fn noise(&self) -> f64 {
        NOISE * largest(self.b.iter())
    }

    /// The largest finite magnitude of both for each column; columns of the same vector have one.
    pub(super) fn scales(&self, vectors: &[usize]) -> Vec<f64> {
        let column = |side: &Array3<f64>, column| largest(side.slice(s![0, column, ..]).iter());
        let mut of_vector =
            vec![0.0f64; vectors.iter().map(|vector| vector + 1).max().unwrap_or(0)];
        for (at, &vector) in vectors.iter().enumerate() {
            let most = column(&self.a, at).max(column(&self.b, at));
            of_vector[vector] = of_vector[vector].max(most);
        }
        vectors.iter().map(|&vector| of_vector[vector]).collect()
    }

    /// Whether no difference is more than noise.
    pub(super) fn is_noise(&self) -> bool {
        let noise = self.noise();
        self.values().all(|(a, b)| a == b || (a.is_nan() && b.is_nan()) || (a - b).abs() <= noise)
    }

    /// Every column divided by its scale.
    pub(super) fn relative_to(&self, scales: &[f64]) -> Self {
        let divided = |side: &Array3<f64>| {
            let mut side = side.clone();
            for (mut column, &scale) in side.axis_iter_mut(Axis(1)).zip(scales) {
                if scale > 0.0 {
                    column /= scale;
                }
            }
            side
        };
        Self { a: divided(&self.a), b: divided(&self.b), axes: self.axes }
    }

    /// Values in the order of their indices.
    pub(super) fn values(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.a.iter().copied().zip(self.b.iter().copied())
    }
}

/// The level of noise for an array of any shape.
pub(super) fn noise(values: &ArrayD<f64>) -> f64 {
    NOISE * largest(values.iter())
}

fn largest<'v>(values: impl Iterator<Item = &'v f64>) -> f64 {
    values.filter(|v| v.is_finite()).fold(0.0, |most, v| most.max(v.abs()))
}

/// A shape without leading axes of length one.
fn trimmed(shape: &[usize]) -> &[usize] {
    let start = shape.iter().position(|&n| n != 1).unwrap_or(shape.len());
    &shape[start..]
}

/// An array as `[channel, coefficient, frame]`, in standard order.
pub(super) fn cube(array: ArrayD<f64>) -> Array3<f64> {
    let shape = array.shape();
    let axis = |back: usize| shape.len().checked_sub(back).map_or(1, |k| shape[k]);
    let (coefficients, frames) = (axis(2), axis(1));
    let channels = shape.iter().rev().skip(2).product();
    let values = if array.is_standard_layout() {
        array.into_raw_vec_and_offset().0
    } else {
        array.iter().copied().collect()
    };
    Array3::from_shape_vec((channels, coefficients, frames), values)
        .expect("the axes multiply to the number of values")
}

/// The index along each axis of the value with this ordinal in standard order.
pub(super) fn index_of(mut ordinal: usize, shape: &[usize]) -> Vec<usize> {
    let mut index = vec![0; shape.len()];
    for (place, &length) in index.iter_mut().zip(shape).rev() {
        *place = ordinal % length.max(1);
        ordinal /= length.max(1);
    }
    index
}
