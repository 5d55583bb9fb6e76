//! One classification tree (CART): greedy binary splits that lower the class impurity most.
//!
//! Features are compared in single precision, as in scikit-learn. Leaves keep class fractions.

use ndarray::{Array2, ArrayView2, Axis};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};

/// Measure of class impurity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Criterion {
    /// 1 − Σp²
    Gini,
    /// −Σ p log p
    Entropy,
}

/// How many features are looked at in each split.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum MaxFeatures {
    /// by rule
    Rule(FeatureRule),
    /// this many
    Count(usize),
    /// this part of all
    Fraction(f64),
}

/// Rules for the number of features looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FeatureRule {
    /// all of them
    All,
    /// ⌊√n⌋
    Sqrt,
    /// ⌊log₂ n⌋
    Log2,
}

impl MaxFeatures {
    pub(super) fn is_valid(self) -> bool {
        match self {
            Self::Rule(_) => true,
            Self::Count(n) => n >= 1,
            Self::Fraction(f) => f > 0.0 && f <= 1.0,
        }
    }

    fn of(self, n_features: usize) -> usize {
        let n = n_features as f64;
        let count = match self {
            Self::Rule(FeatureRule::All) => n_features,
            Self::Rule(FeatureRule::Sqrt) => n.sqrt() as usize,
            Self::Rule(FeatureRule::Log2) => n.log2() as usize,
            Self::Count(count) => count,
            Self::Fraction(part) => (part * n) as usize,
        };
        count.clamp(1, n_features)
    }
}

/// What limits the growth of a tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Growth {
    pub criterion: Criterion,
    pub max_depth: Option<usize>,
    pub min_samples_split: usize,
    pub min_samples_leaf: usize,
    pub max_features: MaxFeatures,
    /// thresholds drawn at random instead of searched
    pub random_thresholds: bool,
}

/// Training rows by column, in single precision.
pub(super) struct Columns {
    /// `[features, rows]`
    values: Array2<f32>,
}

impl Columns {
    /// # Errors
    /// [`ModelError::NonFinite`] for values beyond the range of single precision.
    pub(super) fn new(x: ArrayView2<'_, f64>) -> Result<Self> {
        let mut values = Array2::<f32>::zeros((x.ncols(), x.nrows()));
        // Row blocks keep both sides of the transposition in the cache.
        for (mut columns, rows) in
            values.axis_chunks_iter_mut(Axis(1), 32).zip(x.axis_chunks_iter(Axis(0), 32))
        {
            columns.zip_mut_with(&rows.t(), |to, &from| *to = from as f32);
        }
        if let Some(((feature, row), _)) = values.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(ModelError::NonFinite { row, feature, value: x[[row, feature]] });
        }
        Ok(Self { values })
    }

    fn column(&self, feature: usize) -> &[f32] {
        let rows = self.values.ncols();
        let all = self.values.as_slice().expect("a new array is contiguous");
        &all[feature * rows..(feature + 1) * rows]
    }
}

const LEAF: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Node {
    /// feature compared, or [`LEAF`]
    feature: u32,
    /// rows with value ≤ threshold go left
    threshold: f32,
    /// left child (the right one follows it), or the number of the leaf
    next: u32,
}

/// A fitted tree.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// class fractions, leaf after leaf
    leaves: Vec<f32>,
}

/// The labels and weights a tree grows on.
pub(super) struct Sample<'a> {
    pub y: &'a [u32],
    /// row weights; rows of weight zero are left out
    pub weights: &'a [f32],
    pub n_classes: usize,
}

struct Split {
    feature: usize,
    threshold: f32,
    gain: f64,
}

/// A node waiting to be split: its rows are `start..end` of the row list.
struct Open {
    node: usize,
    start: usize,
    end: usize,
    depth: usize,
}

/// Values to be sorted above which the features of one node are shared among threads.
const PARALLEL_WORK: usize = 200_000;

impl Tree {
    /// Grows a tree; the same seed gives the same tree.
    pub(super) fn grow(columns: &Columns, sample: &Sample<'_>, growth: &Growth, seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut rows: Vec<u32> =
            (0..sample.y.len() as u32).filter(|&i| sample.weights[i as usize] > 0.0).collect();
        let n_features = columns.values.nrows();
        let mut features: Vec<u32> = (0..n_features as u32).collect();
        let mut spare = Vec::with_capacity(rows.len());
        let mut tree = Self { nodes: vec![PLACEHOLDER], leaves: Vec::new() };
        let mut open = vec![Open { node: 0, start: 0, end: rows.len(), depth: 0 }];
        while let Some(at) = open.pop() {
            let members = &mut rows[at.start..at.end];
            let mut totals = vec![0.0; sample.n_classes];
            for &row in members.iter() {
                totals[sample.y[row as usize] as usize] += f64::from(sample.weights[row as usize]);
            }
            let pure = totals.iter().filter(|&&t| t > 0.0).count() < 2;
            let stop = pure
                || growth.max_depth.is_some_and(|deepest| at.depth >= deepest)
                || members.len() < growth.min_samples_split
                || members.len() < 2 * growth.min_samples_leaf;
            let split = if stop {
                None
            } else {
                let search = Search { columns, sample, growth, rows: members, totals: &totals };
                search.best(&mut features, &mut rng)
            };
            let Some(split) = split else {
                tree.close(at.node, &totals);
                continue;
            };
            let middle = at.start + partition(members, columns.column(split.feature), split.threshold, &mut spare);
            let left = tree.nodes.len();
            tree.nodes.extend([PLACEHOLDER; 2]);
            tree.nodes[at.node] = Node {
                feature: split.feature as u32,
                threshold: split.threshold,
                next: left as u32,
            };
            let depth = at.depth + 1;
            open.push(Open { node: left + 1, start: middle, end: at.end, depth });
            open.push(Open { node: left, start: at.start, end: middle, depth });
        }
        tree
    }

    fn close(&mut self, node: usize, totals: &[f64]) {
        let sum: f64 = totals.iter().sum();
        let leaf = (self.leaves.len() / totals.len()) as u32;
        self.nodes[node] = Node { feature: LEAF, threshold: 0.0, next: leaf };
        self.leaves.extend(totals.iter().map(|t| (t / sum) as f32));
    }

    /// Class fractions of the leaf that `row` falls into.
    pub(super) fn leaf(&self, row: &[f32], n_classes: usize) -> &[f32] {
        let mut node = self.nodes[0];
        while node.feature != LEAF {
            let right = row[node.feature as usize] > node.threshold;
            node = self.nodes[node.next as usize + usize::from(right)];
        }
        let start = node.next as usize * n_classes;
        &self.leaves[start..start + n_classes]
    }

    /// Whether every walk ends in a leaf that exists.
    pub(super) fn validate(&self, n_features: usize, n_classes: usize) -> Result<()> {
        let leaves = self.leaves.len().checked_div(n_classes).unwrap_or(0);
        let sound = !self.nodes.is_empty()
            && self.leaves.iter().all(|v| v.is_finite())
            && self.nodes.iter().enumerate().all(|(i, node)| {
                let next = node.next as usize;
                if node.feature == LEAF {
                    next < leaves
                } else {
                    // Children lie behind their parent: no walk can go round.
                    (node.feature as usize) < n_features && next > i && next + 1 < self.nodes.len()
                }
            });
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("tree".into())) }
    }
}

const PLACEHOLDER: Node = Node { feature: LEAF, threshold: 0.0, next: 0 };

/// Moves the rows with `values ≤ threshold` to the front, keeping the order; returns their count.
fn partition(rows: &mut [u32], values: &[f32], threshold: f32, spare: &mut Vec<u32>) -> usize {
    spare.clear();
    let mut left = 0;
    for i in 0..rows.len() {
        let row = rows[i];
        if values[row as usize] <= threshold {
            rows[left] = row;
            left += 1;
        } else {
            spare.push(row);
        }
    }
    rows[left..].copy_from_slice(spare);
    left
}

/// The search for the best split of one node.
struct Search<'a> {
    columns: &'a Columns,
    sample: &'a Sample<'a>,
    growth: &'a Growth,
    rows: &'a [u32],
    totals: &'a [f64],
}

impl Search<'_> {
    /// Looks at features in random order until enough of them, and at least one that varies, have
    /// been seen. The first of equal splits wins.
    fn best(&self, features: &mut [u32], rng: &mut Xoshiro256PlusPlus) -> Option<Split> {
        let wanted = self.growth.max_features.of(features.len());
        if !self.growth.random_thresholds
            && wanted > 1
            && wanted.saturating_mul(self.rows.len()) >= PARALLEL_WORK
        {
            return self.best_parallel(features, wanted, rng);
        }
        let mut scratch = Scratch::default();
        let mut best: Option<Split> = None;
        let mut varied = false;
        for i in 0..features.len() {
            if i >= wanted && varied {
                break;
            }
            let pick = rng.gen_range(i..features.len());
            features.swap(i, pick);
            let feature = features[i] as usize;
            let found = if self.growth.random_thresholds {
                self.random_split(feature, rng, &mut scratch)
            } else {
                self.exhaustive_split(feature, &mut scratch)
            };
            let Some(found) = found else { continue };
            varied = true;
            if found.gain > best.as_ref().map_or(f64::NEG_INFINITY, |b| b.gain) {
                best = Some(found);
            }
        }
        best.filter(|b| b.gain.is_finite())
    }

    /// The same for big nodes, the first `wanted` features at once.
    fn best_parallel(
        &self,
        features: &mut [u32],
        wanted: usize,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Option<Split> {
        for i in 0..wanted {
            let pick = rng.gen_range(i..features.len());
            features.swap(i, pick);
        }
        let found: Vec<_> = features[..wanted]
            .par_iter()
            .map_init(Scratch::default, |scratch, &f| self.exhaustive_split(f as usize, scratch))
            .collect();
        let mut best: Option<Split> = None;
        let mut varied = false;
        let mut consider = |found: Option<Split>| {
            let Some(found) = found else { return false };
            if found.gain > best.as_ref().map_or(f64::NEG_INFINITY, |b| b.gain) {
                best = Some(found);
            }
            true
        };
        for found in found {
            varied |= consider(found);
        }
        let mut scratch = Scratch::default();
        for i in wanted..features.len() {
            if varied {
                break;
            }
            let pick = rng.gen_range(i..features.len());
            features.swap(i, pick);
            varied |= consider(self.exhaustive_split(features[i] as usize, &mut scratch));
        }
        best.filter(|b| b.gain.is_finite())
    }

    /// The best threshold of one feature; `None` if it does not vary here.
    fn exhaustive_split(&self, feature: usize, scratch: &mut Scratch) -> Option<Split> {
        let column = self.columns.column(feature);
        let keys = &mut scratch.keys;
        keys.clear();
        // Value (as an integer of the same order) above, row below: one plain integer sort.
        keys.extend(self.rows.iter().map(|&r| u64::from(ordered(column[r as usize])) << 32 | u64::from(r)));
        let (mut low, mut high) = (u64::MAX, 0);
        for &key in keys.iter() {
            low = low.min(key);
            high = high.max(key);
        }
        if low >> 32 == high >> 32 {
            return None;
        }
        keys.sort_unstable();
        let mut tally = Tally::new(self.growth.criterion, self.totals, &mut scratch.left, &mut scratch.right);
        let leaf = self.growth.min_samples_leaf;
        let mut best = Split { feature, threshold: 0.0, gain: f64::NEG_INFINITY };
        let mut best_at = 0;
        for at in 1..keys.len() {
            let row = keys[at - 1] as u32 as usize;
            tally.shift(self.sample.y[row] as usize, f64::from(self.sample.weights[row]));
            if keys[at] >> 32 == keys[at - 1] >> 32 || at < leaf || keys.len() - at < leaf {
                continue;
            }
            let gain = tally.gain();
            if gain > best.gain {
                best.gain = gain;
                best_at = at;
            }
        }
        if best_at > 0 {
            let value = |at: usize| column[keys[at] as u32 as usize];
            best.threshold = between(value(best_at - 1), value(best_at));
        }
        Some(best)
    }

    /// A threshold drawn between the smallest and the largest value.
    fn random_split(
        &self,
        feature: usize,
        rng: &mut Xoshiro256PlusPlus,
        scratch: &mut Scratch,
    ) -> Option<Split> {
        let column = self.columns.column(feature);
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for &row in self.rows {
            let v = column[row as usize];
            low = low.min(v);
            high = high.max(v);
        }
        if low >= high {
            return None;
        }
        let drawn = f64::from(low) + rng.r#gen::<f64>() * (f64::from(high) - f64::from(low));
        let mut threshold = drawn as f32;
        if threshold >= high || threshold < low {
            threshold = low;
        }
        let mut tally = Tally::new(self.growth.criterion, self.totals, &mut scratch.left, &mut scratch.right);
        tally.left.fill(0.0);
        let mut count = 0;
        for &row in self.rows {
            let row = row as usize;
            let goes_left = column[row] <= threshold;
            count += usize::from(goes_left);
            let weight = if goes_left { f64::from(self.sample.weights[row]) } else { 0.0 };
            tally.left[self.sample.y[row] as usize] += weight;
        }
        tally.recount(self.totals);
        let leaf = self.growth.min_samples_leaf;
        let allowed = count >= leaf && self.rows.len() - count >= leaf;
        let gain = if allowed { tally.gain() } else { f64::NEG_INFINITY };
        Some(Split { feature, threshold, gain })
    }
}

/// Buffers reused from feature to feature.
#[derive(Default)]
struct Scratch {
    keys: Vec<u64>,
    left: Vec<f64>,
    right: Vec<f64>,
}

/// Class weights on both sides of a moving threshold.
struct Tally<'a> {
    criterion: Criterion,
    left: &'a mut Vec<f64>,
    right: &'a mut Vec<f64>,
    left_sum: f64,
    right_sum: f64,
    /// Σ of squares on either side, kept up to date for gini
    left_squares: f64,
    right_squares: f64,
}

impl<'a> Tally<'a> {
    /// Everything on the right.
    fn new(criterion: Criterion, totals: &[f64], left: &'a mut Vec<f64>, right: &'a mut Vec<f64>) -> Self {
        left.clear();
        left.resize(totals.len(), 0.0);
        right.clear();
        right.extend_from_slice(totals);
        Self {
            criterion,
            left,
            right,
            left_sum: 0.0,
            right_sum: totals.iter().sum(),
            left_squares: 0.0,
            right_squares: totals.iter().map(|t| t * t).sum(),
        }
    }

    /// Sums anew from the left side.
    fn recount(&mut self, totals: &[f64]) {
        for ((right, left), total) in self.right.iter_mut().zip(self.left.iter()).zip(totals) {
            *right = total - left;
        }
        self.left_sum = self.left.iter().sum();
        self.right_sum = self.right.iter().sum();
        self.left_squares = self.left.iter().map(|t| t * t).sum();
        self.right_squares = self.right.iter().map(|t| t * t).sum();
    }

    /// One row goes from right to left.
    fn shift(&mut self, class: usize, weight: f64) {
        let (left, right) = (&mut self.left[class], &mut self.right[class]);
        self.left_squares += weight * (2.0 * *left + weight);
        self.right_squares -= weight * (2.0 * *right - weight);
        *left += weight;
        *right -= weight;
        self.left_sum += weight;
        self.right_sum -= weight;
    }

    /// Larger is purer: minus the weighted impurity of both sides, up to a constant of the node.
    fn gain(&self) -> f64 {
        match self.criterion {
            Criterion::Gini => {
                self.left_squares / self.left_sum + self.right_squares / self.right_sum
            }
            Criterion::Entropy => {
                let side = |counts: &[f64], sum: f64| -> f64 {
                    counts.iter().filter(|&&c| c > 0.0).map(|c| c * (c / sum).ln()).sum()
                };
                side(self.left, self.left_sum) + side(self.right, self.right_sum)
            }
        }
    }
}

/// Bits of `value` as an integer that sorts the same way; both zeros are one.
fn ordered(value: f32) -> u32 {
    let bits = (value + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// A threshold with `low ≤ threshold < high`.
fn between(low: f32, high: f32) -> f32 {
    let middle = ((f64::from(low) + f64::from(high)) / 2.0) as f32;
    if middle >= high || middle < low { low } else { middle }
}
