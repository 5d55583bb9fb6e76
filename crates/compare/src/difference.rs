//! How far two sets of numbers are apart.

use serde::Serialize;

/// What counts as equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tolerance {
    /// A share of the largest magnitude of the two arrays, or of the two columns of tables; the
    /// coefficients of a vector count as one column.
    OfLargest(f64),
    /// For each value `atol + rtol * |b|`, as `numpy.allclose(equal_nan=True)`.
    Each {
        /// Absolute part.
        atol: f64,
        /// Part relative to the second file's value.
        rtol: f64,
    },
}

impl Default for Tolerance {
    /// A hundred thousandth of the largest magnitude: ten times what librosa's own single precision
    /// differs from double.
    fn default() -> Self {
        Self::OfLargest(1e-5)
    }
}

impl Tolerance {
    /// The limit for values with this largest magnitude.
    pub(super) fn limit(self, largest: f64) -> Limit {
        match self {
            Self::OfLargest(share) => Limit { atol: share * largest, rtol: 0.0 },
            Self::Each { atol, rtol } => Limit { atol, rtol },
        }
    }
}

/// `atol + rtol * |b|`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    atol: f64,
    rtol: f64,
}

impl Limit {
    /// Whether two values are equal under the limit; NaN equals NaN.
    pub(super) fn holds(self, a: f64, b: f64) -> bool {
        same(a, b) || (b.is_finite() && (a - b).abs() <= self.atol + self.rtol * b.abs())
    }
}

/// Equal, or both NaN.
fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// The largest difference and where it is.
#[derive(Debug, Clone, Serialize)]
pub struct Extreme {
    /// `|a - b|`.
    pub value: f64,
    /// Value in the first file.
    pub a: f64,
    /// Value in the second.
    pub b: f64,
    /// Recording or array.
    pub array: String,
    /// Where in it, in words.
    pub position: String,
    /// Where in it, along each axis.
    pub index: Vec<usize>,
    /// Whether it is beyond the tolerance.
    pub is_beyond: bool,
}

/// Statistics of the differences between values that stand in the same places.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Difference {
    /// Values compared.
    pub values: u64,
    /// Values that are equal.
    pub equal: u64,
    /// Values equal under the tolerance.
    pub within: u64,
    /// Values that are finite in one file only.
    pub one_sided: u64,
    /// The largest difference beyond the tolerance, where there is none the largest; of finite values.
    pub largest: Option<Extreme>,
    /// Largest `|a - b|`.
    pub max_absolute: f64,
    /// Largest `|a - b| / max(|a|, |b|)`.
    pub max_relative: f64,
    /// Root of the mean square of the differences of finite values.
    pub rms: f64,
    /// Pearson's correlation of finite values; `None` where one side does not vary.
    pub correlation: Option<f64>,
    #[serde(skip)]
    moments: Moments,
}

/// Counts, means and centred second moments, to be joined over arrays.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    mean: [f64; 2],
    squares: [f64; 2],
    product: f64,
    differences: f64,
}

impl Difference {
    /// Adds the values of one pair of arrays. `limit` is that of the value with this ordinal; `locate`
    /// gives its array, position and index.
    pub(super) fn add(
        &mut self,
        values: impl Iterator<Item = (f64, f64)>,
        limit: impl Fn(usize) -> Limit,
        locate: impl FnOnce(usize) -> (String, String, Vec<usize>),
    ) {
        let mut largest = self.largest.as_ref().map_or((false, 0.0), |e| (e.is_beyond, e.value));
        let mut worst = None;
        let mut moments = Moments::default();
        for (ordinal, (a, b)) in values.enumerate() {
            self.values += 1;
            self.equal += u64::from(same(a, b));
            let is_within = limit(ordinal).holds(a, b);
            self.within += u64::from(is_within);
            if !(a.is_finite() && b.is_finite()) {
                self.one_sided += u64::from(!same(a, b));
                continue;
            }
            moments.push(a, b);
            let value = (a - b).abs();
            self.max_absolute = self.max_absolute.max(value);
            if value > 0.0 {
                self.max_relative = self.max_relative.max(value / a.abs().max(b.abs()));
            }
            if (!is_within, value) > largest {
                largest = (!is_within, value);
                worst = Some((ordinal, a, b));
            }
        }
        if let Some((ordinal, a, b)) = worst {
            let (array, position, index) = locate(ordinal);
            let (is_beyond, value) = largest;
            self.largest = Some(Extreme { value, a, b, array, position, index, is_beyond });
        }
        self.moments.join(moments);
        self.rms = (self.moments.differences / self.moments.count.max(1.0)).sqrt();
        self.correlation = self.moments.correlation();
    }
}

impl Moments {
    fn push(&mut self, a: f64, b: f64) {
        self.count += 1.0;
        let step = [a - self.mean[0], b - self.mean[1]];
        self.mean[0] += step[0] / self.count;
        self.mean[1] += step[1] / self.count;
        self.squares[0] += step[0] * (a - self.mean[0]);
        self.squares[1] += step[1] * (b - self.mean[1]);
        self.product += step[0] * (b - self.mean[1]);
        self.differences += (a - b) * (a - b);
    }

    /// Chan, Golub and LeVeque's update for the union of two samples.
    fn join(&mut self, other: Self) {
        let count = self.count + other.count;
        if other.count == 0.0 {
            return;
        }
        let step = [other.mean[0] - self.mean[0], other.mean[1] - self.mean[1]];
        let weight = self.count * other.count / count;
        for (side, step) in step.into_iter().enumerate() {
            self.squares[side] += other.squares[side] + step * step * weight;
            self.mean[side] += step * other.count / count;
        }
        self.product += other.product + step[0] * step[1] * weight;
        self.differences += other.differences;
        self.count = count;
    }

    fn correlation(&self) -> Option<f64> {
        let scale = (self.squares[0] * self.squares[1]).sqrt();
        (scale > 0.0).then(|| (self.product / scale).clamp(-1.0, 1.0))
    }
}
