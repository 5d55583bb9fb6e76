//! One classification tree (CART): greedy binary splits that lower the class impurity most.
//!
//! Features are compared in single precision, as in scikit-learn. Leaves keep class fractions.

mod columns;
mod sample;
mod split;
mod tally;
mod tree;

use serde::{Deserialize, Serialize};

pub(super) use columns::FeatureColumns;
pub(super) use sample::Sample;
pub(super) use tree::Tree;

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
