//! Extremely randomised trees (Geurts et al. 2006): thresholds drawn at random, the best of the
//! drawn features kept.

use ndarray::ArrayView2;

use super::Train;
use super::cart::FeatureRule;
use super::trees::{MAX_TREES, Plan, Trees, tree_parameters};
use crate::error::Result;

tree_parameters! {
    /// Parameters of extremely randomised trees.
    ExtraTreesParams, "et" {
        first {
            trees: usize = 100, "a whole number from 1 to 100000", "number of trees";
        }
        max_features: FeatureRule::Sqrt;
        then {
            bootstrap: bool = false, "true or false", "draw rows with replacement for each tree";
            #[serde(skip_serializing_if = "std::ops::Not::not")]
            oob_score: bool = false, "true or false (needs bootstrap=true)",
                "ask each tree about the rows that it has not seen (Python: oob_score_)";
        }
        last {}
    }
    random_thresholds: true;
    check(this) {
        Self::require((1..=MAX_TREES).contains(&this.trees), "trees", this.trees)?;
        Self::require(this.bootstrap || !this.oob_score, "oob_score", this.oob_score)
    }
}

impl Train for ExtraTreesParams {
    type Fitted = Trees;
    const FEWEST_CLASSES: usize = 1;

    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Trees> {
        self.grow(x, y, n_classes, None)
    }

    fn train_weighted(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: &[f64],
    ) -> Result<Trees> {
        self.grow(x, y, n_classes, Some(weights))
    }
}

impl ExtraTreesParams {
    fn grow(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<Trees> {
        let plan = Plan {
            growth: self.growth(),
            n_trees: self.trees,
            bootstrap: self.bootstrap,
            out_of_bag: self.oob_score,
            class_weight: &self.class_weight,
            seed: self.seed,
        };
        Trees::grow(x, y, n_classes, weights, &plan)
    }
}
