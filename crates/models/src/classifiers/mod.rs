//! The classifiers, and the table that names them.
//!
//! A classifier is a parameter struct ([`parameters!`](crate::parameters)) that implements [`Train`],
//! and a fitted type that implements [`Classify`]. Those that come with the crate are one file here
//! and one line in the table of `spec.rs` each. [`register`] adds a classifier of another crate: it
//! then has a name in [`ClassifierSpec::new`], trains in pipelines and cross-validations, and is kept
//! in model files. `examples/own_classifier.rs` shows one.

mod cart;
mod classifier;
mod classify;
mod decision_tree;
mod extra_trees;
mod fitted;
mod knn;
mod logistic;
mod random_forest;
mod registry;
mod spec;
mod svm;
mod trees;

pub use cart::{Criterion, MaxFeatures};
pub use classifier::{Classifier, MAX_CLASSES, Predicted};
pub use classify::{Classify, Neighbours, Train};
pub use decision_tree::{DecisionTreeParams, TreeSolver};
pub use extra_trees::ExtraTreesParams;
pub use knn::{KNearestParams, Metric, Search, Weights};
pub use logistic::LogisticParams;
pub use random_forest::RandomForestParams;
pub use registry::RegisteredSpec;
pub use spec::{CLASSIFIERS, ClassifierSpec, classifiers, register};
pub use svm::{Gamma, SvmKernel, SvmParams, SvmSolver};
