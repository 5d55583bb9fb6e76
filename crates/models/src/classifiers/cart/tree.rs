//! A tree: how it grows, and where it sends a row.

use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use super::Growth;
use super::columns::FeatureColumns;
use super::sample::Sample;
use super::split::Search;
use super::tally::purity;
use crate::error::{ModelError, Result};

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
pub(in crate::classifiers) struct Tree {
    nodes: Vec<Node>,
    /// class fractions, leaf after leaf
    leaves: Vec<f32>,
}

/// A node waiting to be split: its rows are `start..end` of the row list.
struct Open {
    node: usize,
    start: usize,
    end: usize,
    depth: usize,
}

impl Tree {
    /// Grows a tree; the same seed gives the same tree. Also gives the features of its splits with
    /// their shares of the impurity that all splits took away.
    pub(in crate::classifiers) fn grow(
        columns: &FeatureColumns,
        sample: &Sample<'_>,
        growth: &Growth,
        seed: u64,
    ) -> (Self, Vec<(u32, f64)>) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let counts = |&row: &u32| sample.times[row as usize] > 0;
        let mut rows: Vec<u32> = (0..sample.y.len() as u32).filter(counts).collect();
        // Class after class, and so in every node: partitioning keeps the order.
        rows.sort_by_key(|&row| sample.y[row as usize]);
        let n_features = columns.count();
        let mut features: Vec<u32> = (0..n_features as u32).collect();
        let mut spare = Vec::with_capacity(rows.len());
        let mut tree = Self { nodes: vec![PLACEHOLDER], leaves: Vec::new() };
        let mut decreases = vec![0.0; n_features];
        let mut open = vec![Open { node: 0, start: 0, end: rows.len(), depth: 0 }];
        while let Some(at) = open.pop() {
            let members = &mut rows[at.start..at.end];
            let mut totals = vec![0.0; sample.class_weights.len()];
            let mut ends: Vec<(usize, usize)> = Vec::new();
            for (at, &row) in members.iter().enumerate() {
                let class = sample.y[row as usize] as usize;
                totals[class] += sample.weight(row as usize);
                match ends.last_mut() {
                    Some(last) if last.0 == class => last.1 = at + 1,
                    _ => ends.push((class, at + 1)),
                }
            }
            let pure = totals.iter().filter(|&&t| t > 0.0).count() < 2;
            let stop = pure
                || growth.max_depth.is_some_and(|deepest| at.depth >= deepest)
                || members.len() < growth.min_samples_split
                || members.len() < 2 * growth.min_samples_leaf;
            let split = if stop {
                None
            } else {
                let times = members.iter().map(|&row| sample.times[row as usize]).collect();
                let search =
                    Search { columns, sample, growth, rows: members, times, ends, totals: &totals };
                search.best(&mut features, &mut rng)
            };
            let Some(split) = split else {
                tree.close(at.node, &totals);
                continue;
            };
            decreases[split.feature] += (split.gain - purity(growth.criterion, &totals)).max(0.0);
            let middle = at.start
                + partition(members, columns.column(split.feature), split.threshold, &mut spare);
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
        (tree, shares(&decreases))
    }

    fn close(&mut self, node: usize, totals: &[f64]) {
        let sum: f64 = totals.iter().sum();
        let leaf = (self.leaves.len() / totals.len()) as u32;
        self.nodes[node] = Node { feature: LEAF, threshold: 0.0, next: leaf };
        self.leaves.extend(totals.iter().map(|t| (t / sum) as f32));
    }

    /// Class fractions of the leaves that `rows` fall into.
    pub(in crate::classifiers) fn leaves<const N: usize>(
        &self,
        rows: [&[f32]; N],
        n_classes: usize,
    ) -> [&[f32]; N] {
        // Every step waits for memory, so several rows walk at once.
        let mut at = [0; N];
        let mut walking = true;
        while walking {
            walking = false;
            for (at, row) in at.iter_mut().zip(rows) {
                let node = self.nodes[*at];
                if node.feature != LEAF {
                    let right = row[node.feature as usize] > node.threshold;
                    *at = node.next as usize + usize::from(right);
                    walking = true;
                }
            }
        }
        at.map(|at| {
            let start = self.nodes[at].next as usize * n_classes;
            &self.leaves[start..start + n_classes]
        })
    }

    /// Whether every walk ends in a leaf that exists.
    pub(in crate::classifiers) fn validate(
        &self,
        n_features: usize,
        n_classes: usize,
    ) -> Result<()> {
        let leaves = self.leaves.len().checked_div(n_classes).unwrap_or(0);
        let sound = !self.nodes.is_empty()
            && self.leaves.iter().all(|v| v.is_finite())
            && self.nodes.iter().enumerate().all(|(i, node)| {
                let next = node.next as usize;
                if node.feature == LEAF {
                    next < leaves
                } else {
                    // Children lie after their parent: no walk can go round.
                    (node.feature as usize) < n_features && next > i && next + 1 < self.nodes.len()
                }
            });
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("tree".into())) }
    }
}

/// The features that took impurity away, with their shares of the sum.
fn shares(decreases: &[f64]) -> Vec<(u32, f64)> {
    let sum: f64 = decreases.iter().sum();
    let share = |(feature, &decrease): (usize, &f64)| (feature as u32, decrease / sum);
    decreases.iter().enumerate().filter(|(_, decrease)| **decrease > 0.0).map(share).collect()
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
