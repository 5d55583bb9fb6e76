//! Extremely randomised trees (Geurts et al. 2006): thresholds drawn at random, the best of the
//! drawn features kept.

use ndarray::ArrayView2;

use super::Train;
use super::cart::{Criterion, FeatureRule, Growth, MaxFeatures};
use super::trees::{MAX_TREES, Plan, Trees};
use crate::error::Result;
use crate::params::{ClassWeight, parameters};

parameters! {
    /// Parameters of extremely randomised trees.
    ExtraTreesParams, "et" {
        trees: usize = 100, "a whole number from 1 to 100000", "number of trees";
        criterion: Criterion = Criterion::Gini, "gini or entropy", "measure of impurity";
        max_depth: Option<usize> = None, "a whole number of at least 1, or null", "deepest level";
        min_samples_split: usize = 2, "a whole number of at least 2", "fewest rows to split";
        min_samples_leaf: usize = 1, "a whole number of at least 1", "fewest rows in a leaf";
        max_features: MaxFeatures = MaxFeatures::Rule(FeatureRule::Sqrt),
            "sqrt, log2, all, a whole number of at least 1, or a fraction up to 1.0",
            "features looked at in each split";
        bootstrap: bool = false, "true or false", "draw rows with replacement for each tree";
        class_weight: ClassWeight = ClassWeight::Equal,
            "null, balanced, or one positive number per class in label order", "weight of each class";
        seed: u64 = 0, "a whole number", "seed of all draws";
    }
    check(this) {
        Self::require((1..=MAX_TREES).contains(&this.trees), "trees", this.trees)?;
        Self::require(this.max_depth != Some(0), "max_depth", 0)?;
        Self::require(this.min_samples_split >= 2, "min_samples_split", this.min_samples_split)?;
        Self::require(this.min_samples_leaf >= 1, "min_samples_leaf", this.min_samples_leaf)?;
        Self::require(this.max_features.is_valid(), "max_features", format!("{:?}", this.max_features))?;
        Self::require(this.class_weight.is_valid(), "class_weight", format!("{:?}", this.class_weight))
    }
}

/// The fitted trees.
pub(super) type ExtraTrees = Trees;

impl Train for ExtraTreesParams {
    type Fitted = Trees;
    const FEWEST_CLASSES: usize = 1;

    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Trees> {
        let growth = Growth {
            criterion: self.criterion,
            max_depth: self.max_depth,
            min_samples_split: self.min_samples_split,
            min_samples_leaf: self.min_samples_leaf,
            max_features: self.max_features,
            random_thresholds: true,
        };
        let plan = Plan {
            growth,
            n_trees: self.trees,
            bootstrap: self.bootstrap,
            class_weight: &self.class_weight,
            seed: self.seed,
        };
        Trees::grow(x, y, n_classes, &plan)
    }
}
