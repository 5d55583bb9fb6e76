//! One or many trees whose leaf fractions are averaged.

mod plan;

use ndarray::{Array2, ArrayView2, Axis};
use rand::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Classify;
use super::cart::{FeatureColumns, Sample, Tree};
use crate::error::{ModelError, Result};

pub(super) use plan::Plan;
use plan::Weighing;

/// Trees with the shape of what they were grown on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trees {
    n_features: usize,
    n_classes: usize,
    trees: Vec<Tree>,
    /// known after training
    #[serde(skip)]
    importances: Option<Vec<f64>>,
    #[serde(skip)]
    out_of_bag: Option<Array2<f64>>,
}

/// Most trees of an ensemble.
pub(super) const MAX_TREES: usize = 100_000;

/// Declares the parameters of a method that grows trees: those of its own, then those that all have.
macro_rules! tree_parameters {
    (
        $(#[$meta:meta])*
        $name:ident, $owner:literal {
            first { $($first:tt)* }
            max_features: $rule:expr;
            then { $($then:tt)* }
            last { $($last:tt)* }
        }
        random_thresholds: $random_thresholds:literal;
        check($this:ident) $check:block
    ) => {
        $crate::params::parameters! {
            $(#[$meta])*
            $name, $owner {
                $($first)*
                criterion: $crate::classifiers::Criterion = $crate::classifiers::Criterion::Gini,
                    "gini or entropy", "measure of impurity";
                max_depth: Option<usize> = None,
                    "a whole number of at least 1, or null", "deepest level";
                min_samples_split: usize = 2,
                    "a whole number of at least 2", "fewest rows to split";
                min_samples_leaf: usize = 1,
                    "a whole number of at least 1", "fewest rows in a leaf";
                max_features: $crate::classifiers::MaxFeatures =
                    $crate::classifiers::MaxFeatures::Rule($rule),
                    "sqrt, log2, all, a whole number of at least 1, or a fraction up to 1.0",
                    "number of features considered in each split";
                $($then)*
                class_weight: $crate::params::ClassWeight = $crate::params::ClassWeight::Equal,
                    "null, balanced, or one positive number per class in label order",
                    "weight of each class";
                seed: u64 = 0, "a whole number", "seed of all draws";
                $($last)*
            }
            check(params) {
                let $this = params;
                Self::require($this.max_depth != Some(0), "max_depth", 0)?;
                Self::require(
                    $this.min_samples_split >= 2, "min_samples_split", $this.min_samples_split,
                )?;
                Self::require(
                    $this.min_samples_leaf >= 1, "min_samples_leaf", $this.min_samples_leaf,
                )?;
                let features = $this.max_features;
                Self::require(features.is_valid(), "max_features", format!("{features:?}"))?;
                let weight = &$this.class_weight;
                Self::require(weight.is_valid(), "class_weight", format!("{weight:?}"))?;
                $check
            }
        }

        impl $name {
            fn growth(&self) -> $crate::classifiers::cart::Growth {
                $crate::classifiers::cart::Growth {
                    criterion: self.criterion,
                    max_depth: self.max_depth,
                    min_samples_split: self.min_samples_split,
                    min_samples_leaf: self.min_samples_leaf,
                    max_features: self.max_features,
                    random_thresholds: $random_thresholds,
                }
            }
        }
    };
}
pub(super) use tree_parameters;

/// Declares the parameters of an ensemble of trees, and trains it.
macro_rules! forest {
    (
        $(#[$meta:meta])*
        $name:ident, $owner:literal, bootstrap: $bootstrap:literal,
        random_thresholds: $random_thresholds:literal
    ) => {
        $crate::classifiers::trees::tree_parameters! {
            $(#[$meta])*
            $name, $owner {
                first {
                    trees: usize = 100, "a whole number from 1 to 100000", "number of trees";
                }
                max_features: $crate::classifiers::cart::FeatureRule::Sqrt;
                then {
                    bootstrap: bool = $bootstrap, "true or false",
                        "draw rows with replacement for each tree";
                    #[serde(skip_serializing_if = "std::ops::Not::not")]
                    oob_score: bool = false, "true or false (needs bootstrap=true)",
                        "score each tree on the rows that it has not seen (Python: oob_score_)";
                }
                last {}
            }
            random_thresholds: $random_thresholds;
            check(this) {
                let most = $crate::classifiers::trees::MAX_TREES;
                Self::require((1..=most).contains(&this.trees), "trees", this.trees)?;
                Self::require(this.bootstrap || !this.oob_score, "oob_score", this.oob_score)
            }
        }

        impl $crate::classifiers::Train for $name {
            type Fitted = $crate::classifiers::trees::Trees;
            const FEWEST_CLASSES: usize = 1;

            fn train(
                &self,
                x: ndarray::ArrayView2<'_, f64>,
                y: &[usize],
                n_classes: usize,
            ) -> $crate::error::Result<Self::Fitted> {
                Self::Fitted::grow(x, y, n_classes, None, &self.plan())
            }

            fn train_weighted(
                &self,
                x: ndarray::ArrayView2<'_, f64>,
                y: &[usize],
                n_classes: usize,
                weights: &[f64],
            ) -> $crate::error::Result<Self::Fitted> {
                Self::Fitted::grow(x, y, n_classes, Some(weights), &self.plan())
            }
        }

        impl $name {
            fn plan(&self) -> $crate::classifiers::trees::Plan<'_> {
                $crate::classifiers::trees::Plan {
                    growth: self.growth(),
                    n_trees: self.trees,
                    bootstrap: self.bootstrap,
                    out_of_bag: self.oob_score,
                    class_weight: &self.class_weight,
                    balances_weights: true,
                    seed: self.seed,
                }
            }
        }
    };
}
pub(super) use forest;

/// Most rows predicted together: each tree comes into the cache once per block.
const ROW_BLOCK: usize = 256;
/// Rows that walk through a tree at once.
const TOGETHER: usize = 8;
/// Values of a block that stay in the cache.
const BLOCK_VALUES: usize = 1 << 17;
/// Blocks there should at least be, for the threads to share.
const BLOCKS: usize = 8;

impl Trees {
    /// Grows the trees in parallel, each from its own seed: the number of threads does not matter.
    /// Rows count by their weights, which are the chances to be drawn where a tree has a sample of its
    /// own, as in scikit-learn 1.9.
    pub(super) fn grow(
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
        plan: &Plan<'_>,
    ) -> Result<Self> {
        if u32::try_from(x.nrows()).is_err() || u32::try_from(x.ncols()).is_err() {
            return Err(ModelError::Numerical {
                owner: "trees",
                reason: format!("{} rows x {} features are too many", x.nrows(), x.ncols()),
            });
        }
        let columns = FeatureColumns::new(x)?;
        let weighing = Weighing::new(plan, y, n_classes, weights)?;
        let labels: Vec<u32> = y.iter().map(|&c| c as u32).collect();
        let mut seeds = Xoshiro256PlusPlus::seed_from_u64(plan.seed);
        let seeds: Vec<u64> = (0..plan.n_trees).map(|_| seeds.next_u64()).collect();
        let (trees, shares): (Vec<Tree>, Vec<Vec<(u32, f64)>>) = seeds
            .par_iter()
            .map(|&seed| {
                let (times, mut rng) = plan.draw(seed, y.len(), weighing.upto.as_deref());
                let sample = Sample {
                    y: &labels,
                    times: &times,
                    class_weights: &weighing.of_class,
                    row_weights: weighing.of_row.as_deref(),
                };
                Tree::grow(&columns, &sample, &plan.growth, rng.next_u64())
            })
            .unzip();
        let importances = Some(mean_importances(&shares, x.ncols()));
        let mut grown =
            Self { n_features: x.ncols(), n_classes, trees, importances, out_of_bag: None };
        if plan.out_of_bag {
            grown.out_of_bag = Some(grown.left_out(x, &seeds, plan, weighing.upto.as_deref()));
        }
        Ok(grown)
    }

    /// Class fractions `[rows, classes]` by the trees that have not seen each row, NaN where all have.
    fn left_out(
        &self,
        x: ArrayView2<'_, f64>,
        seeds: &[u64],
        plan: &Plan<'_>,
        upto: Option<&[f64]>,
    ) -> Array2<f64> {
        // So many trees at once that a row's word says which of them have not seen it.
        const TREES: usize = u64::BITS as usize;
        let mut fractions = Array2::<f64>::zeros((x.nrows(), self.n_classes));
        for (trees, seeds) in self.trees.chunks(TREES).zip(seeds.chunks(TREES)) {
            let mut unseen = vec![0u64; x.nrows()];
            for (bit, &seed) in seeds.iter().enumerate() {
                let (times, _) = plan.draw(seed, x.nrows(), upto);
                let marks = times.iter().map(|&times| u64::from(times == 0) << bit);
                unseen.iter_mut().zip(marks).for_each(|(unseen, mark)| *unseen |= mark);
            }
            let rows = fractions.axis_iter_mut(Axis(0)).into_par_iter().zip(x.axis_iter(Axis(0)));
            rows.zip(unseen).for_each(|((mut sums, row), unseen)| {
                let row: Vec<f32> = row.iter().map(|&value| value as f32).collect();
                let by = trees.iter().enumerate().filter(|(bit, _)| unseen >> bit & 1 == 1);
                for (_, tree) in by {
                    let [leaf] = tree.leaves([&row], self.n_classes);
                    sums.iter_mut().zip(leaf).for_each(|(sum, &p)| *sum += f64::from(p));
                }
            });
        }
        for mut row in fractions.outer_iter_mut() {
            let sum = row.sum();
            row /= sum;
        }
        fractions
    }
}

/// Mean of the trees' shares, summing to one; zeros if no tree has a split.
fn mean_importances(shares: &[Vec<(u32, f64)>], n_features: usize) -> Vec<f64> {
    let mut importances = vec![0.0; n_features];
    for &(feature, share) in shares.iter().flatten() {
        importances[feature as usize] += share;
    }
    let sum: f64 = importances.iter().sum();
    if sum > 0.0 {
        importances.iter_mut().for_each(|importance| *importance /= sum);
    }
    importances
}

impl Trees {
    /// Adds the leaf fractions of one tree: `rows` `[rows, features]`, `sums` `[rows, classes]`.
    fn add(&self, tree: &Tree, rows: &[f32], sums: &mut [f64]) {
        let (features, classes) = (self.n_features, self.n_classes);
        let add = |sums: &mut [f64], leaf: &[f32]| {
            sums.iter_mut().zip(leaf).for_each(|(s, &p)| *s += f64::from(p));
        };
        let groups = rows.chunks(TOGETHER * features).zip(sums.chunks_mut(TOGETHER * classes));
        for (rows, sums) in groups {
            if rows.len() == TOGETHER * features {
                let rows = std::array::from_fn(|i| &rows[i * features..(i + 1) * features]);
                let leaves: [_; TOGETHER] = tree.leaves(rows, classes);
                sums.chunks_mut(classes).zip(leaves).for_each(|(sums, leaf)| add(sums, leaf));
                continue;
            }
            for (row, sums) in rows.chunks(features).zip(sums.chunks_mut(classes)) {
                let [leaf] = tree.leaves([row], classes);
                add(sums, leaf);
            }
        }
    }
}

impl Classify for Trees {
    fn n_features(&self) -> usize {
        self.n_features
    }

    fn n_classes(&self) -> usize {
        self.n_classes
    }

    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let mut proba = Array2::zeros((x.nrows(), self.n_classes));
        let block = (BLOCK_VALUES / self.n_features).min(x.nrows().div_ceil(BLOCKS));
        let block = block.clamp(TOGETHER, ROW_BLOCK);
        proba
            .axis_chunks_iter_mut(Axis(0), block)
            .into_par_iter()
            .zip(x.axis_chunks_iter(Axis(0), block))
            .for_each(|(mut out, rows)| {
                // Out of single range saturates: still on the right side of every threshold.
                let rows = rows.mapv(|v| v as f32).as_standard_layout().into_owned();
                let rows = rows.as_slice().expect("standard layout");
                let mut sums = vec![0.0; out.len()];
                for tree in &self.trees {
                    self.add(tree, rows, &mut sums);
                }
                out.iter_mut().zip(sums).for_each(|(o, s)| *o = s);
                for mut row in out.outer_iter_mut() {
                    // Single precision fractions: their sum is one only to seven digits.
                    let sum = row.sum();
                    row /= sum;
                }
            });
        Ok(proba)
    }

    fn feature_importances(&self) -> Option<&[f64]> {
        self.importances.as_deref()
    }

    fn out_of_bag(&self) -> Option<ArrayView2<'_, f64>> {
        self.out_of_bag.as_ref().map(|fractions| fractions.view())
    }

    fn validate(&self) -> Result<()> {
        if self.trees.is_empty() || self.n_features == 0 || self.n_classes == 0 {
            return Err(ModelError::Inconsistent("forest without trees".into()));
        }
        self.trees.iter().try_for_each(|t| t.validate(self.n_features, self.n_classes))
    }
}
