//! A single decision tree, grown here or by linfa-trees.

mod linfa;

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use super::Train;
use super::cart::FeatureRule;
use super::trees::{Plan, Trees, tree_parameters};
use crate::error::{ModelError, Result};

pub(super) use linfa::{LinfaTree, STORED_NAME};

/// Who grows the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TreeSolver {
    /// this crate
    #[default]
    Own,
    /// linfa-trees: no probabilities
    Linfa,
}

impl TreeSolver {
    fn is_own(&self) -> bool {
        *self == Self::Own
    }
}

tree_parameters! {
    /// Parameters of a decision tree.
    DecisionTreeParams, "tree" {
        first {}
        max_features: FeatureRule::All;
        then {}
        last {
            #[serde(skip_serializing_if = "TreeSolver::is_own")]
            solver: TreeSolver = TreeSolver::Own, "own or linfa",
                "this program's algorithm, or linfa-trees (no probabilities)";
        }
    }
    random_thresholds: false;
    check(this) {
        match this.solver {
            TreeSolver::Own => Ok(()),
            TreeSolver::Linfa => linfa::check(&this.growth(), &this.class_weight),
        }
    }
}

/// A fitted tree of either solver.
pub enum FittedTree {
    Own(Trees),
    Linfa(LinfaTree),
}

impl Train for DecisionTreeParams {
    type Fitted = FittedTree;
    const FEWEST_CLASSES: usize = 1;

    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<FittedTree> {
        match self.solver {
            TreeSolver::Own => self.grow(x, y, n_classes, None),
            TreeSolver::Linfa => {
                LinfaTree::train(&self.growth(), x, y, n_classes).map(FittedTree::Linfa)
            }
        }
    }

    fn train_weighted(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: &[f64],
    ) -> Result<FittedTree> {
        match self.solver {
            TreeSolver::Own => self.grow(x, y, n_classes, Some(weights)),
            TreeSolver::Linfa => {
                Err(ModelError::Lacks { what: "sample weights", which: "train with solver=own" })
            }
        }
    }
}

impl DecisionTreeParams {
    fn grow(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<FittedTree> {
        let plan = Plan {
            growth: self.growth(),
            n_trees: 1,
            bootstrap: false,
            out_of_bag: false,
            class_weight: &self.class_weight,
            balances_weights: false,
            seed: self.seed,
        };
        Trees::grow(x, y, n_classes, weights, &plan).map(FittedTree::Own)
    }
}
