//! What is kept of a classifier after fitting.

use serde::{Deserialize, Serialize};

use super::Classify;
use super::decision_tree::{self, FittedTree};
use super::knn::{self, FittedNeighbours, KNearest};
use super::logistic::Logistic;
use super::registry::Registered;
use super::svm::Svm;
use super::trees::Trees;

/// A fitted classifier. Model files store the position in this list, which therefore stays; what is
/// new is stored by name, as [`Fitted::Registered`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Fitted {
    KNearest(KNearest),
    Svm(Svm),
    DecisionTree(Trees),
    RandomForest(Trees),
    ExtraTrees(Trees),
    Logistic(Logistic),
    Registered(Registered),
}

impl Fitted {
    pub(super) fn of_tree(tree: FittedTree) -> Self {
        match tree {
            FittedTree::Own(trees) => Self::DecisionTree(trees),
            FittedTree::Linfa(tree) => {
                Self::Registered(Registered::new(decision_tree::STORED_NAME, tree))
            }
        }
    }

    pub(super) fn of_neighbours(neighbours: FittedNeighbours) -> Self {
        match neighbours {
            FittedNeighbours::Own(model) => Self::KNearest(model),
            FittedNeighbours::Linfa(model) => {
                Self::Registered(Registered::new(knn::STORED_NAME, model))
            }
        }
    }

    pub(super) fn as_classify(&self) -> &dyn Classify {
        match self {
            Self::KNearest(model) => model,
            Self::Svm(model) => model,
            Self::DecisionTree(model) | Self::RandomForest(model) | Self::ExtraTrees(model) => {
                model
            }
            Self::Logistic(model) => model,
            Self::Registered(model) => model.as_classify(),
        }
    }
}
