//! A first look in single precision that rules most training rows out.
//!
//! For query row q and training row t a matrix product gives `‖t‖² − 2q·t`, called the score: the squared
//! distance less ‖q‖² (for unit rows, without ‖t‖²: twice the cosine distance less 2). Its error is bounded,
//! so what is ruled out could not have been among the nearest.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, s};
use rayon::prelude::*;

/// Training rows looked at together: their scores and their part of the product stay in the cache.
const TRAIN_BLOCK: usize = 512;
/// Scores compared together.
const CHUNK: usize = 32;
/// Sums of terms up to this magnitude cannot overflow in single precision.
const SAFE: f64 = 1e37;

/// Rows prepared for the product: centred, one more column, and their squared lengths.
struct Rows {
    /// `[rows, features + 1]`
    x: Array2<f32>,
    norms: Vec<f64>,
}

/// Training rows in single precision.
pub(super) struct Screen {
    rows: Rows,
    /// subtracted before rounding: distances do not change, errors shrink
    centre: Array1<f64>,
    euclidean: bool,
}

/// What is known of the score of a pair of rows.
pub(super) struct Seen {
    /// position of the query row in its block
    pub query: usize,
    /// training row
    pub row: usize,
    /// bounds of the score
    pub low: f64,
    pub high: f64,
}

impl Screen {
    /// For rows under the euclidean metric, or unit rows under the cosine metric.
    pub(super) fn new(x: ArrayView2<'_, f64>, euclidean: bool) -> Self {
        let centre = match euclidean {
            true => x.sum_axis(Axis(0)) / x.nrows() as f64,
            false => Array1::zeros(x.ncols()),
        };
        let rows = prepared(x, &centre, 1.0, |norm| if euclidean { norm as f32 } else { 0.0 });
        Self { rows, centre, euclidean }
    }

    /// Offers the training rows in their order, for each query row those whose score may be at
    /// most the limit that `look` returned last for it (infinity at first).
    pub(super) fn scan(&self, queries: ArrayView2<'_, f64>, mut look: impl FnMut(Seen) -> f64) {
        let own = prepared(queries, &self.centre, -2.0, |_| 1.0);
        let mut limits = vec![f64::INFINITY; queries.nrows()];
        let mut scores = Array2::<f32>::zeros((queries.nrows(), TRAIN_BLOCK));
        for start in (0..self.rows.norms.len()).step_by(TRAIN_BLOCK) {
            let end = (start + TRAIN_BLOCK).min(self.rows.norms.len());
            let mut scores = scores.slice_mut(s![.., ..end - start]);
            let rows = self.rows.x.slice(s![start..end, ..]);
            ndarray::linalg::general_mat_mul(1.0, &own.x, &rows.t(), 0.0, &mut scores);
            let longest = largest(&self.rows.norms[start..end]);
            for (query, limit) in limits.iter_mut().enumerate() {
                let slack = self.slack(own.norms[query], longest)
                    + self.exact_slack(own.norms[query], longest);
                let scores = scores.row(query);
                let scores = scores.to_slice().expect("rows of a new array");
                let mut cut = cut(*limit, slack);
                for (chunk, at) in scores.chunks(CHUNK).zip((start..).step_by(CHUNK)) {
                    if chunk.iter().fold(true, |all, &score| all & ruled_out(score, cut)) {
                        continue;
                    }
                    for (&score, row) in chunk.iter().zip(at..) {
                        if !ruled_out(score, cut) {
                            let (low, high) = bounds(score, slack);
                            *limit = look(Seen { query, row, low, high });
                            cut = self::cut(*limit, slack);
                        }
                    }
                }
            }
        }
    }

    /// Rounding of both factors and of every sum in single precision, and underflow; infinite where
    /// sums may overflow.
    fn slack(&self, query_norm: f64, row_norm: f64) -> f64 {
        let features = self.rows.x.ncols() as f64;
        let terms = 2.0 * (query_norm * row_norm).sqrt() + row_norm;
        let tiny = features * f64::from(f32::MIN_POSITIVE) * (1.0 + query_norm + row_norm);
        let slack = (features + 4.0) * f64::from(f32::EPSILON) * terms + tiny;
        if terms < SAFE { slack } else { f64::INFINITY }
    }

    /// The same of the exact distance and of centred lengths, in double precision.
    fn exact_slack(&self, query_norm: f64, row_norm: f64) -> f64 {
        4.0 * (self.rows.x.ncols() as f64 + 4.0) * f64::EPSILON * (query_norm + row_norm)
    }

    /// The score that goes with a distance (squared, if euclidean) from a query row.
    pub(super) fn score(&self, distance: f64, query: ArrayView1<'_, f64>) -> f64 {
        if !self.euclidean {
            return 2.0 * (distance - 1.0);
        }
        let norm: f64 = query.iter().zip(&self.centre).map(|(q, c)| (q - c) * (q - c)).sum();
        distance - norm
    }
}

/// The smallest single-precision value that no score up to `limit` can exceed.
fn cut(limit: f64, slack: f64) -> f32 {
    if slack.is_finite() { ((limit + slack) as f32).next_up() } else { f32::NAN }
}

/// False for NaN: what overflowed is looked at.
fn ruled_out(score: f32, cut: f32) -> bool {
    score > cut
}

fn bounds(score: f32, slack: f64) -> (f64, f64) {
    let score = f64::from(score);
    if (score + slack).is_finite() {
        (score - slack, score + slack)
    } else {
        (f64::NEG_INFINITY, f64::INFINITY)
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn prepared(
    x: ArrayView2<'_, f64>,
    centre: &Array1<f64>,
    factor: f64,
    last: impl Fn(f64) -> f32 + Sync,
) -> Rows {
    let features = x.ncols();
    let mut low = Array2::<f32>::zeros((x.nrows(), features + 1));
    let norms = low
        .axis_iter_mut(Axis(0))
        .into_par_iter()
        .zip(x.axis_iter(Axis(0)))
        .map_init(
            || Array1::zeros(features),
            |shifted: &mut Array1<f64>, (mut low, row)| {
                shifted.assign(&row);
                *shifted -= centre;
                low.slice_mut(s![..features])
                    .zip_mut_with(shifted, |l, &v| *l = (factor * v) as f32);
                let norm = shifted.dot(shifted);
                low[features] = last(norm);
                norm
            },
        )
        .collect();
    Rows { x: low, norms }
}
