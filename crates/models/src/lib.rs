//! Classifiers for acoustic features: training, prediction, validation, model files.
//!
//! Features are `[rows, features]` in double precision, labels are class indices with a table of
//! names ([`labels::Labels`]). [`classifiers::ClassifierSpec`] names a classifier with its
//! parameters; it implements [`linfa::traits::Fit`], and the fitted
//! [`classifiers::Classifier`] implements linfa's prediction traits.

pub mod classifiers;
pub mod error;
mod lbfgs;
pub mod params;
mod table;
pub mod targets;

pub use error::{ModelError, Result};
pub use table::argmax;
pub mod comparison;
pub mod cross_validation;
pub mod dataset;
pub mod explain;
pub mod folds;
mod formats;
pub mod fusion;
pub mod grid;
pub mod labels;
pub mod model_file;
pub mod mt19937;
pub mod pipeline;
pub mod predictions;
pub mod recipe;
pub mod scores;
pub mod splits;
pub mod spread;
pub mod steps;
pub mod validation;
pub mod voting;
mod words;
