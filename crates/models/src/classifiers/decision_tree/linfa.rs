//! The tree of linfa-trees.
//!
//! It takes values closer than 1e-5 as equal whatever their scale, looks at every feature, and keeps
//! only the commonest class of a leaf. The fitted nodes are copied into a flat list, which can be
//! checked when it comes from a file and walked without recursion.

use linfa::DatasetBase;
use linfa::traits::Fit;
use linfa_trees::{DecisionTree, SplitQuality, TreeNode};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::classifiers::cart::{FeatureRule, Growth, MaxFeatures};
use crate::classifiers::{Classify, Criterion};
use crate::error::{ModelError, Result};
use crate::params::ClassWeight;
use crate::table::argmax;

const OWNER: &str = "tree";

/// The name by which model files know this tree.
pub(in crate::classifiers) const STORED_NAME: &str = "linfa-trees";

/// Most values of a table: each node sorts and scans every column of all rows.
const MAX_VALUES: usize = 20_000_000;

/// linfa-trees descends by recursion: no deeper than this.
const MAX_DEPTH: usize = 512;

/// Refuses parameters that linfa-trees does not have.
pub(super) fn check(growth: &Growth, class_weight: &ClassWeight) -> Result<()> {
    let lacks = |key, value: String, allowed: &str| {
        Err(ModelError::ParameterValue {
            owner: OWNER,
            key,
            value,
            allowed: format!("{allowed} with solver=linfa"),
        })
    };
    if growth.max_features != MaxFeatures::Rule(FeatureRule::All) {
        return lacks("max_features".into(), format!("{:?}", growth.max_features), "all");
    }
    if *class_weight != ClassWeight::Equal {
        return lacks("class_weight".into(), format!("{class_weight:?}"), "null");
    }
    if let Some(depth) = growth.max_depth.filter(|&depth| depth > MAX_DEPTH) {
        return lacks("max_depth".into(), depth.to_string(), "1 to 512");
    }
    Ok(())
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Node {
    /// rows with value < threshold go to the next node, others to `right`
    Split {
        feature: usize,
        threshold: f64,
        right: usize,
    },
    Leaf {
        class: usize,
    },
}

/// A tree that linfa-trees grew.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LinfaTree {
    n_features: usize,
    n_classes: usize,
    /// parents before children, left children directly after their parent
    nodes: Vec<Node>,
}

impl LinfaTree {
    pub(super) fn train(
        growth: &Growth,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
    ) -> Result<Self> {
        let failed = |reason: String| ModelError::Numerical { owner: OWNER, reason };
        if x.len() > MAX_VALUES {
            let (rows, features) = x.dim();
            return Err(failed(format!(
                "{rows} rows x {features} features are too many for solver = linfa (at most \
                 {MAX_VALUES} values): use solver = own"
            )));
        }
        let quality = match growth.criterion {
            Criterion::Gini => SplitQuality::Gini,
            Criterion::Entropy => SplitQuality::Entropy,
        };
        let data = DatasetBase::new(x, Array1::from(y.to_vec()));
        let tree = DecisionTree::params()
            .split_quality(quality)
            .max_depth(Some(growth.max_depth.unwrap_or(MAX_DEPTH)))
            .min_weight_split(growth.min_samples_split as f32)
            .min_weight_leaf(growth.min_samples_leaf as f32)
            .fit(&data)
            .map_err(|e| failed(format!("linfa-trees: {e}")))?;
        let mut fitted = Self { n_features: x.ncols(), n_classes, nodes: Vec::new() };
        fitted.copy(tree.root_node())?;
        fitted.settle_ties(x, y);
        Ok(fitted)
    }

    /// Gives each leaf the commonest class of its training rows, the lowest among equals: which of
    /// equals linfa-trees takes is left to the order of a hash table.
    fn settle_ties(&mut self, x: ArrayView2<'_, f64>, y: &[usize]) {
        let mut counts = vec![vec![0.0; self.n_classes]; self.nodes.len()];
        for (row, &class) in x.outer_iter().zip(y) {
            counts[self.leaf(row)][class] += 1.0;
        }
        for (node, counts) in self.nodes.iter_mut().zip(&counts) {
            if let Node::Leaf { class } = node
                && counts.iter().any(|n| *n > 0.0)
            {
                *class = argmax(counts);
            }
        }
    }

    /// The node in which a row ends.
    fn leaf(&self, row: ArrayView1<'_, f64>) -> usize {
        let mut at = 0;
        loop {
            match self.nodes[at] {
                Node::Leaf { .. } => return at,
                Node::Split { feature, threshold, .. } if row[feature] < threshold => at += 1,
                Node::Split { right, .. } => at = right,
            }
        }
    }

    /// Appends a node and all below it.
    fn copy(&mut self, root: &TreeNode<f64, usize>) -> Result<()> {
        let broken = || ModelError::Numerical {
            owner: OWNER,
            reason: "linfa-trees gave a node without children".into(),
        };
        // A right child knows whose it is.
        let mut open: Vec<(&TreeNode<f64, usize>, Option<usize>)> = vec![(root, None)];
        while let Some((node, parent)) = open.pop() {
            let at = self.nodes.len();
            if let Some(Node::Split { right, .. }) = parent.map(|parent| &mut self.nodes[parent]) {
                *right = at;
            }
            if let Some(class) = node.prediction() {
                self.nodes.push(Node::Leaf { class });
                continue;
            }
            let (feature, threshold, _) = node.split();
            self.nodes.push(Node::Split { feature, threshold, right: 0 });
            let [left, right] = node.children()[..] else { return Err(broken()) };
            open.push((right.as_deref().ok_or_else(broken)?, Some(at)));
            open.push((left.as_deref().ok_or_else(broken)?, None));
        }
        Ok(())
    }
}

impl Classify for LinfaTree {
    fn n_features(&self) -> usize {
        self.n_features
    }

    fn n_classes(&self) -> usize {
        self.n_classes
    }

    fn predict_proba(&self, _: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        Err(ModelError::NoProbability {
            owner: OWNER,
            remedy: "linfa-trees keeps one class per leaf; train with solver=own",
        })
    }

    fn predict(&self, x: ArrayView2<'_, f64>) -> Result<Vec<usize>> {
        let class = |row| match self.nodes[self.leaf(row)] {
            Node::Leaf { class } => class,
            Node::Split { .. } => 0,
        };
        Ok(x.outer_iter().map(class).collect())
    }

    fn validate(&self) -> Result<()> {
        let n = self.nodes.len();
        let node_is_sound = |(at, node): (usize, &Node)| match *node {
            Node::Leaf { class } => class < self.n_classes,
            // Children lie after their parent: no walk can go round.
            Node::Split { feature, threshold, right } => {
                let behind = at + 1 < n && at < right && right < n;
                feature < self.n_features && !threshold.is_nan() && behind
            }
        };
        let sound = n > 0 && self.nodes.iter().enumerate().all(node_is_sound);
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("tree".into())) }
    }
}
