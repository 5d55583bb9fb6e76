//! k nearest neighbours by exhaustive search, in blocks.
//!
//! Euclidean and cosine distances (‖a‖² + ‖b‖² − 2a·b) are first estimated by a matrix product in single
//! precision per block, with an error bound; only rows that may be near are computed exactly. Others come
//! from plain loops. Equal distances are ordered as scikit-learn 1.9's brute-force search orders
//! them (a binary max-heap filled in row order), equal votes go to the lowest class.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, s};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Classify, Train};
use crate::error::{ModelError, Result};
use crate::params::{Parameters, parameters};

/// How near two rows are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Metric {
    /// √Σ(a−b)²
    Euclidean,
    /// Σ|a−b|
    Manhattan,
    /// 1 − cos(a, b); an all-zero row is at distance 1 from everything
    Cosine,
    /// max|a−b|
    Chebyshev,
    /// (Σ|a−b|^p)^(1/p)
    Minkowski,
}

/// How much each neighbour's vote counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Weights {
    /// all alike
    Uniform,
    /// 1/distance; neighbours at distance zero outvote all others
    Distance,
}

parameters! {
    /// Parameters of k nearest neighbours.
    KNearestParams, "knn" {
        k: usize = 5, "a whole number from 1 to the number of training rows", "neighbours that vote";
        weights: Weights = Weights::Uniform, "uniform or distance", "how votes count";
        metric: Metric = Metric::Euclidean,
            "euclidean, manhattan, cosine, chebyshev or minkowski", "distance between rows";
        p: f64 = 2.0, "a number of at least 1", "exponent of the minkowski metric";
    }
    check(this) {
        Self::require(this.k >= 1, "k", this.k)?;
        Self::require(this.p.is_finite() && this.p >= 1.0, "p", this.p)
    }
}

/// The training rows, ready to be searched.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct KNearest {
    k: usize,
    weights: Weights,
    metric: Metric,
    p: f64,
    n_classes: usize,
    /// `[rows, features]`; rows of unit length for the cosine metric
    x: Array2<f64>,
    y: Vec<usize>,
    /// squared row lengths
    norms: Vec<f64>,
}

impl Train for KNearestParams {
    type Fitted = KNearest;
    const FEWEST_CLASSES: usize = 1;

    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<KNearest> {
        if self.k > x.nrows() {
            return Err(ModelError::ParameterValue {
                owner: Self::OWNER,
                key: "k".into(),
                value: self.k.to_string(),
                allowed: format!("there are {} training rows", x.nrows()),
            });
        }
        let x = match self.metric {
            Metric::Cosine => unit_rows(x),
            _ => x.as_standard_layout().into_owned(),
        };
        let norms = squared_lengths(x.view());
        Ok(KNearest {
            k: self.k,
            weights: self.weights,
            metric: self.metric,
            p: self.p,
            n_classes,
            x,
            y: y.to_vec(),
            norms,
        })
    }
}

/// Query rows of one block: enough to keep the matrix product busy, small enough for the cache.
const QUERY_BLOCK: usize = 128;
/// Training rows of one block.
const TRAIN_BLOCK: usize = 512;
/// Fewer query rows than this are not worth a copy of the training rows in single precision.
const SCREEN_FROM: usize = 16;

impl Classify for KNearest {
    fn n_features(&self) -> usize {
        self.x.ncols()
    }

    fn n_classes(&self) -> usize {
        self.n_classes
    }

    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let by_products = matches!(self.metric, Metric::Euclidean | Metric::Cosine);
        let screen = (by_products && x.nrows() >= SCREEN_FROM)
            .then(|| Screen::new(self.x.view(), self.metric == Metric::Euclidean));
        let mut proba = Array2::zeros((x.nrows(), self.n_classes));
        proba
            .axis_chunks_iter_mut(Axis(0), QUERY_BLOCK)
            .into_par_iter()
            .zip(x.axis_chunks_iter(Axis(0), QUERY_BLOCK))
            .for_each(|(mut votes, block)| {
                let heaps = self.search(block, screen.as_ref());
                for (mut row, heap) in votes.outer_iter_mut().zip(heaps) {
                    self.vote(&heap, row.as_slice_mut().expect("rows of a new array"));
                }
            });
        Ok(proba)
    }

    fn validate(&self) -> Result<()> {
        let n = self.x.nrows();
        let sound = (1..=n).contains(&self.k)
            && self.p.is_finite()
            && self.p >= 1.0
            && self.y.len() == n
            && self.norms.len() == n
            && self.x.is_standard_layout()
            && self.x.iter().chain(&self.norms).all(|v| v.is_finite())
            && self.y.iter().all(|&c| c < self.n_classes);
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("neighbours".into())) }
    }
}

/// Training rows in single precision, for a first look that rules most of them out. Its errors are
/// bounded, so what is ruled out could not have been among the nearest.
struct Screen {
    x: Array2<f32>,
    /// subtracted before rounding: distances do not change, errors shrink
    centre: Array1<f64>,
    norms: Vec<f64>,
}

impl Screen {
    fn new(x: ArrayView2<'_, f64>, centred: bool) -> Self {
        let rows = x.nrows() as f64;
        let centre = match centred {
            true => x.sum_axis(Axis(0)) / rows,
            false => Array1::zeros(x.ncols()),
        };
        let (x, norms) = Self::lower(x, &centre);
        Self { x, centre, norms }
    }

    fn lower(x: ArrayView2<'_, f64>, centre: &Array1<f64>) -> (Array2<f32>, Vec<f64>) {
        let shifted = &x - centre;
        (shifted.mapv(|v| v as f32), squared_lengths(shifted.view()))
    }
}

impl KNearest {
    /// The k nearest training rows of each query row; squared distances for the euclidean metric.
    fn search(&self, block: ArrayView2<'_, f64>, screen: Option<&Screen>) -> Vec<Nearest> {
        let block = match self.metric {
            Metric::Cosine => unit_rows(block),
            _ => block.as_standard_layout().into_owned(),
        };
        let norms = squared_lengths(block.view());
        let mut heaps = vec![Nearest::new(self.k); block.nrows()];
        let Some(screen) = screen else {
            for ((heap, query), &norm) in heaps.iter_mut().zip(block.outer_iter()).zip(&norms) {
                for row in 0..self.x.nrows() {
                    heap.push(self.distance(query, norm, row), row);
                }
            }
            return heaps;
        };
        let (low, low_norms) = Screen::lower(block.view(), &screen.centre);
        // Rounding of both factors and of every sum: (n + 4)·u·‖a‖‖b‖ for a product, twice that for
        // a squared distance; the double precision formula's own errors are far below.
        let unit = 2.0 * (self.x.ncols() as f64 + 4.0) * f64::from(f32::EPSILON) / 2.0;
        let mut products = Array2::zeros((block.nrows(), TRAIN_BLOCK));
        for start in (0..self.x.nrows()).step_by(TRAIN_BLOCK) {
            let end = (start + TRAIN_BLOCK).min(self.x.nrows());
            let mut products = products.slice_mut(s![.., ..end - start]);
            let rows = screen.x.slice(s![start..end, ..]);
            ndarray::linalg::general_mat_mul(1.0, &low, &rows.t(), 0.0, &mut products);
            for (q, heap) in heaps.iter_mut().enumerate() {
                let length = low_norms[q].sqrt();
                for ((j, &dot), &low_norm) in products.row(q).iter().enumerate().zip(&screen.norms[start..end]) {
                    let dot = f64::from(dot);
                    let about = match self.metric {
                        Metric::Cosine => 1.0 - dot,
                        _ => low_norms[q] + low_norm - 2.0 * dot,
                    };
                    let slack = unit * length * low_norm.sqrt() + 1e-12 * (norms[q] + self.norms[start + j]);
                    let least = about - slack;
                    // What overflowed is looked at.
                    let ruled_out = least.is_finite() && least >= heap.farthest();
                    if !ruled_out {
                        heap.push(self.distance(block.row(q), norms[q], start + j), start + j);
                    }
                }
            }
        }
        heaps
    }

    /// Distance of a query row with squared length `norm` to training row `row`.
    fn distance(&self, query: ArrayView1<'_, f64>, norm: f64, row: usize) -> f64 {
        let other = self.x.row(row);
        let (a, b) = (query.as_slice().unwrap_or(&[]), other.as_slice().unwrap_or(&[]));
        match self.metric {
            Metric::Euclidean => norm + self.norms[row] - 2.0 * query.dot(&other),
            Metric::Cosine => (1.0 - query.dot(&other)).clamp(0.0, 2.0),
            Metric::Manhattan => lanes(a, b, |sum, d| sum + d.abs(), |x, y| x + y),
            Metric::Chebyshev => lanes(a, b, |max, d| d.abs().max(max), f64::max),
            Metric::Minkowski => {
                let p = self.p;
                lanes(a, b, |sum, d| sum + d.abs().powf(p), |x, y| x + y).powf(1.0 / p)
            }
        }
    }

    /// Class fractions of the neighbours' votes.
    fn vote(&self, nearest: &Nearest, votes: &mut [f64]) {
        let neighbours = nearest.sorted();
        let distance = |d: f64| if self.metric == Metric::Euclidean { d.sqrt() } else { d };
        let on_top = neighbours[0].0 == 0.0;
        for (d, row) in neighbours {
            let weight = match self.weights {
                Weights::Uniform => 1.0,
                Weights::Distance if on_top => f64::from(u8::from(d == 0.0)),
                // Bounded, so that the sum over all neighbours stays finite.
                Weights::Distance => (1.0 / distance(d)).min(1e300),
            };
            votes[self.y[row]] += weight;
        }
        let total: f64 = votes.iter().sum();
        votes.iter_mut().for_each(|v| *v /= total);
    }
}

/// Folds the differences of two rows in four independent lanes.
fn lanes(a: &[f64], b: &[f64], step: impl Fn(f64, f64) -> f64, join: impl Fn(f64, f64) -> f64) -> f64 {
    let mut acc = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail = a4.remainder().iter().zip(b4.remainder());
    let tail = tail.fold(0.0, |s, (x, y)| step(s, x - y));
    for (x, y) in a4.zip(b4) {
        for i in 0..4 {
            acc[i] = step(acc[i], x[i] - y[i]);
        }
    }
    join(join(join(acc[0], acc[1]), join(acc[2], acc[3])), tail)
}

fn squared_lengths(x: ArrayView2<'_, f64>) -> Vec<f64> {
    x.outer_iter().map(|row| row.dot(&row)).collect()
}

fn unit_rows(x: ArrayView2<'_, f64>) -> Array2<f64> {
    let lengths: Array1<f64> = squared_lengths(x).into_iter().map(f64::sqrt).collect();
    let lengths = lengths.mapv(|l| if l == 0.0 { 1.0 } else { l });
    x.as_standard_layout().into_owned() / &lengths.insert_axis(Axis(1))
}

/// The k smallest (distance, row) so far: a binary heap with the largest on top. Which of several
/// equal distances survive follows from this very layout, so it is spelled out here.
#[derive(Clone, Debug)]
struct Nearest(Vec<(f64, usize)>);

impl Nearest {
    fn new(k: usize) -> Self {
        Self(vec![(f64::INFINITY, usize::MAX); k])
    }

    fn push(&mut self, distance: f64, row: usize) {
        let heap = &mut self.0;
        // Rounding can give a little less than zero, overflow infinity or NaN: farthest of all.
        let distance = if distance < f64::MAX { distance.max(0.0) } else { f64::MAX };
        if distance >= heap[0].0 {
            return;
        }
        let mut at = 0;
        loop {
            let (left, right) = (2 * at + 1, 2 * at + 2);
            let child = match (heap.get(left), heap.get(right)) {
                (None, _) => break,
                (Some(l), Some(r)) if r.0 > l.0 => right,
                _ => left,
            };
            if heap[child].0 <= distance {
                break;
            }
            heap[at] = heap[child];
            at = child;
        }
        heap[at] = (distance, row);
    }

    /// The largest distance kept; infinite until there are k.
    fn farthest(&self) -> f64 {
        self.0[0].0
    }

    /// Nearest first.
    fn sorted(&self) -> Vec<(f64, usize)> {
        let mut found = self.0.clone();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found
    }
}
