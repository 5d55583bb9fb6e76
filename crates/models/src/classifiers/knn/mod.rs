//! k nearest neighbours by exhaustive search, in blocks.
//!
//! Euclidean and cosine distances (‖a‖² + ‖b‖² − 2a·b) are first estimated in single precision with an
//! error bound ([`screen`]); only rows that may be near are computed exactly, euclidean distances from
//! differences. Others come from plain loops. Equal distances are ordered as scikit-learn 1.9's
//! brute-force search orders them (a binary max-heap filled in row order, [`nearest`]), equal votes go to
//! the lowest class.

mod linfa;
mod nearest;
mod params;
mod screen;

use ndarray::{ArcArray2, Array1, Array2, ArrayView1, ArrayView2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use nearest::Nearest;
use screen::Screen;

pub(super) use linfa::{LinfaNeighbours, STORED_NAME};
pub(super) use params::FittedNeighbours;
pub use params::{KNearestParams, Search};

use super::{Classify, Neighbours};
use crate::error::{ModelError, Result};

const OWNER: &str = "knn";

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

/// The training rows, ready to be searched.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct KNearest {
    k: usize,
    weights: Weights,
    metric: Metric,
    p: f64,
    n_classes: usize,
    /// `[rows, features]`, shared with who trained it where that can be; rows of unit length for the cosine metric
    x: ArcArray2<f64>,
    y: Vec<usize>,
    /// squared row lengths, by which linfa's search refuses what it overflows on
    norms: Vec<f64>,
}

/// Most query rows of one block: enough to keep the matrix product busy, small enough for the cache.
const QUERY_BLOCK: usize = 256;
/// Blocks there should at least be, for the threads to share.
const BLOCKS: usize = 8;
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
        let (screen, rows) = self.prepare(x)?;
        let mut proba = Array2::zeros((x.nrows(), self.n_classes));
        proba
            .axis_chunks_iter_mut(Axis(0), rows)
            .into_par_iter()
            .zip(x.axis_chunks_iter(Axis(0), rows))
            .for_each(|(mut votes, block)| {
                let heaps = self.search(block, screen.as_ref(), self.k);
                for (mut row, heap) in votes.outer_iter_mut().zip(heaps) {
                    self.vote(heap, row.as_slice_mut().expect("rows of a new array"));
                }
            });
        Ok(proba)
    }

    fn neighbours(&self, x: Option<ArrayView2<'_, f64>>, k: usize) -> Result<Neighbours> {
        let among_others = x.is_none();
        let most = self.x.nrows() - usize::from(among_others);
        if !(1..=most).contains(&k) {
            return Err(ModelError::ParameterValue {
                owner: OWNER,
                key: "k".into(),
                value: k.to_string(),
                allowed: format!("1 to {most} ({} training rows)", self.x.nrows()),
            });
        }
        let x = x.as_ref().map_or(self.x.view(), |x| x.view());
        let (screen, block) = self.prepare(x)?;
        let mut found = Neighbours {
            distances: Array2::zeros((x.nrows(), k)),
            rows: Array2::zeros((x.nrows(), k)),
        };
        let wanted = k + usize::from(among_others);
        let places = found.distances.axis_chunks_iter_mut(Axis(0), block).into_par_iter();
        places
            .zip(found.rows.axis_chunks_iter_mut(Axis(0), block))
            .zip(x.axis_chunks_iter(Axis(0), block))
            .enumerate()
            .for_each(|(at, ((mut distances, mut rows), queries))| {
                let heaps = self.search(queries, screen.as_ref(), wanted);
                for (place, heap) in heaps.into_iter().enumerate() {
                    let mut nearest = heap.sorted();
                    if among_others {
                        // Where so many rows equal it that it is not among them, one of those goes.
                        let own = at * block + place;
                        let own = nearest.iter().position(|(_, row)| *row == own).unwrap_or(0);
                        nearest.remove(own);
                    }
                    for (rank, (distance, row)) in nearest.into_iter().enumerate() {
                        distances[[place, rank]] = self.true_distance(distance);
                        rows[[place, rank]] = row;
                    }
                }
            });
        Ok(found)
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

impl KNearest {
    /// The screen, if it is worth its making, and the number of query rows in a block.
    fn prepare(&self, x: ArrayView2<'_, f64>) -> Result<(Option<Screen>, usize)> {
        check_lengths(&squared_lengths(x))?;
        let by_products = matches!(self.metric, Metric::Euclidean | Metric::Cosine);
        let screen = (by_products && x.nrows() >= SCREEN_FROM)
            .then(|| Screen::new(self.x.view(), self.metric == Metric::Euclidean));
        Ok((screen, x.nrows().div_ceil(BLOCKS).clamp(SCREEN_FROM, QUERY_BLOCK)))
    }

    /// The distance that [`search`](Self::search) found, as people know it.
    fn true_distance(&self, found: f64) -> f64 {
        if self.metric == Metric::Euclidean { found.sqrt() } else { found }
    }

    /// The k nearest training rows of each query row; squared distances for the euclidean metric.
    fn search(
        &self,
        block: ArrayView2<'_, f64>,
        screen: Option<&Screen>,
        k: usize,
    ) -> Vec<Nearest> {
        let block = match self.metric {
            Metric::Cosine => unit_rows(block),
            _ => block.as_standard_layout().into_owned(),
        };
        let Some(screen) = screen else {
            let nearest = |query: ArrayView1<'_, f64>| {
                let mut heap = Nearest::new(k);
                (0..self.x.nrows()).for_each(|row| heap.push(self.distance(query, row), row));
                heap
            };
            return block.outer_iter().map(nearest).collect();
        };
        let found: Vec<Option<Nearest>> = self
            .candidates(block.view(), screen, k)
            .into_iter()
            .enumerate()
            .map(|(q, rows)| {
                let exact = |row| (self.distance(block.row(q), row), row);
                Nearest::of(k, rows.into_iter().map(exact).collect())
            })
            .collect();
        let tied: Vec<usize> = (0..found.len()).filter(|&q| found[q].is_none()).collect();
        let mut in_order =
            self.in_order(block.select(Axis(0), &tied).view(), screen, k).into_iter();
        found
            .into_iter()
            .map(|f| f.or_else(|| in_order.next()))
            .map(|f| f.expect("one per tie"))
            .collect()
    }

    /// Training rows, for each query row, among which the k nearest are.
    fn candidates(&self, block: ArrayView2<'_, f64>, screen: &Screen, k: usize) -> Vec<Vec<usize>> {
        // Per query row the k lowest upper bounds, ascending, and what was below the last of them.
        let mut highs = vec![Vec::with_capacity(k + 1); block.nrows()];
        let mut seen = vec![Vec::new(); block.nrows()];
        screen.scan(block, |pair| {
            let highs: &mut Vec<f64> = &mut highs[pair.query];
            highs.insert(highs.partition_point(|&h| h <= pair.high), pair.high);
            highs.truncate(k);
            seen[pair.query].push((pair.low, pair.row));
            if highs.len() < k { f64::INFINITY } else { highs[k - 1] }
        });
        let below = |(seen, highs): (Vec<(f64, usize)>, Vec<f64>)| {
            let limit = highs[k - 1];
            seen.into_iter().filter(|&(low, _)| low <= limit).map(|(_, row)| row).collect()
        };
        seen.into_iter().zip(highs).map(below).collect()
    }

    /// The same with every training row offered in its order, for rows whose ties matter.
    fn in_order(&self, block: ArrayView2<'_, f64>, screen: &Screen, k: usize) -> Vec<Nearest> {
        let mut heaps = vec![Nearest::new(k); block.nrows()];
        screen.scan(block, |pair| {
            let (heap, query) = (&mut heaps[pair.query], block.row(pair.query));
            heap.push(self.distance(query, pair.row), pair.row);
            screen.score(heap.farthest(), query)
        });
        heaps
    }

    /// Distance of a query row to training row `row`; squared, if euclidean.
    fn distance(&self, query: ArrayView1<'_, f64>, row: usize) -> f64 {
        let other = self.x.row(row);
        let (a, b) = (query.as_slice().unwrap_or(&[]), other.as_slice().unwrap_or(&[]));
        match self.metric {
            // Of lengths and a product nothing would be left where a feature is far from zero.
            Metric::Euclidean => lanes(a, b, |sum, d| sum + d * d, |x, y| x + y),
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
    fn vote(&self, nearest: Nearest, votes: &mut [f64]) {
        let neighbours = nearest.sorted();
        let on_top = neighbours[0].0 == 0.0;
        for (d, row) in neighbours {
            let weight = match self.weights {
                Weights::Uniform => 1.0,
                Weights::Distance if on_top => f64::from(u8::from(d == 0.0)),
                // Bounded, so that the sum over all neighbours stays finite.
                Weights::Distance => (1.0 / self.true_distance(d)).min(1e300),
            };
            votes[self.y[row]] += weight;
        }
        let total: f64 = votes.iter().sum();
        votes.iter_mut().for_each(|v| *v /= total);
    }
}

/// Folds the differences of two rows in four independent lanes.
fn lanes(
    a: &[f64],
    b: &[f64],
    step: impl Fn(f64, f64) -> f64,
    join: impl Fn(f64, f64) -> f64,
) -> f64 {
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

/// Refuses rows whose squared length is beyond the range of numbers.
fn check_lengths(squared: &[f64]) -> Result<()> {
    match squared.iter().position(|norm| !norm.is_finite()) {
        None => Ok(()),
        Some(row) => Err(ModelError::Numerical {
            owner: OWNER,
            reason: format!(
                "the features of row {row} are too large for distances: standardize them"
            ),
        }),
    }
}

fn squared_lengths(x: ArrayView2<'_, f64>) -> Vec<f64> {
    x.axis_iter(Axis(0)).into_par_iter().map(|row| row.dot(&row)).collect()
}

/// A copy made by all threads, and its squared row lengths.
fn copied(x: ArrayView2<'_, f64>) -> (ArcArray2<f64>, Vec<f64>) {
    let mut copy = Array2::zeros(x.raw_dim());
    let norms = copy
        .axis_iter_mut(Axis(0))
        .into_par_iter()
        .zip(x.axis_iter(Axis(0)))
        .map(|(mut to, from)| {
            to.assign(&from);
            to.dot(&to)
        })
        .collect();
    (copy.into_shared(), norms)
}

fn unit_rows(x: ArrayView2<'_, f64>) -> Array2<f64> {
    let lengths: Array1<f64> = squared_lengths(x).into_iter().map(f64::sqrt).collect();
    let lengths = lengths.mapv(|l| if l == 0.0 { 1.0 } else { l });
    x.as_standard_layout().into_owned() / &lengths.insert_axis(Axis(1))
}
