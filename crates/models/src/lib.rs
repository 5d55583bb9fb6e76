//! Classifiers for acoustic features: training, prediction, validation, model files.
//!
//! Features are `[rows, features]` in double precision, labels are class indices with a table of
//! names ([`labels::Labels`]). [`classifiers::ClassifierSpec`] names a classifier with its
//! parameters; it implements [`linfa::traits::Fit`], and the fitted
//! [`classifiers::Classifier`] implements linfa's prediction traits.
//!
//! Train, save, load, predict:
//!
//! ```
//! use corsmal_models::classifiers::ClassifierSpec;
//! use corsmal_models::labels::Labels;
//! use corsmal_models::model_file::{Model, ModelHeader};
//! use corsmal_models::params::key_values;
//! use corsmal_models::pipeline::PipelineSpec;
//! use ndarray::array;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("type.model");
//! let x = array![[0.0, 0.1], [0.2, 0.0], [3.0, 3.1], [2.9, 3.0]];
//! let (labels, y) = Labels::of(&["rice", "rice", "water", "water"]);
//! let forest = ClassifierSpec::new("rf", &key_values(&["trees=20"])?)?;
//! let pipeline = PipelineSpec::standardized(forest);
//! let fitted = pipeline.train(x.view(), &y, labels.len())?;
//! Model::new(ModelHeader::new(pipeline, labels), fitted)?.save(&path)?;
//!
//! let model = Model::load(&path)?;
//! let classes = model.predict(array![[2.5, 2.5]].view())?;
//! assert_eq!(model.header().labels.names()[classes[0]], "water");
//! # Ok(())
//! # }
//! ```
//!
//! | task | module |
//! |---|---|
//! | read features with labels | [`dataset`], [`labels`] |
//! | choose, train and store a pipeline | [`classifiers`], [`steps`], [`pipeline`], [`model_file`] |
//! | score on rows that were not trained on | [`cv_plan`], [`folds`], [`splits`], [`cross_validation`], [`scores`] |
//! | choose parameters, explain a model | [`grid`], [`validation`], [`explain`] |
//! | read, write, join and compare predictions | [`predictions`], [`fusion`], [`voting`], [`comparison`] |

pub mod classifiers;
pub mod comparison;
mod copies;
pub mod cross_validation;
pub mod cv_plan;
pub mod dataset;
mod dominance;
pub mod error;
pub mod explain;
pub mod folds;
mod formats;
pub mod fusion;
pub mod grid;
pub mod groups;
pub mod labels;
mod lbfgs;
mod lengths;
pub mod model_file;
mod mt19937;
pub mod params;
pub mod pipeline;
pub mod predictions;
pub mod request;
pub mod scores;
pub mod splits;
pub mod spread;
pub mod steps;
mod table;
pub mod targets;
pub mod validation;
pub mod voting;
mod words;

pub use dominance::dominance;
pub use error::{ModelError, Result};
pub use table::argmax;
