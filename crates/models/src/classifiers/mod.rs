//! The classifiers, and the table that names them.
//!
//! A classifier is a parameter struct ([`parameters!`](crate::parameters)) that implements [`Train`],
//! and a fitted type that implements [`Classify`]. Those that come with the crate are one file here
//! and one line in the table of `spec.rs` each. [`register`] adds a classifier of another crate: it
//! then has a name in [`ClassifierSpec::new`], trains in pipelines and cross-validations, and is kept
//! in model files. `examples/own_classifier.rs` shows one.

mod cart;
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

use std::fmt::Debug;

use linfa::DatasetBase;
use linfa::traits::{Fit, PredictInplace};
use ndarray::{Array1, Array2, ArrayBase, ArrayView2, Axis, Data, Ix2};
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};
use crate::params::Parameters;
use crate::table::{argmax, check_query};
use fitted::Fitted;

pub use cart::{Criterion, MaxFeatures};
pub use decision_tree::{DecisionTreeParams, TreeSolver};
pub use extra_trees::ExtraTreesParams;
pub use knn::{KNearestParams, Metric, Search, Weights};
pub use logistic::LogisticParams;
pub use random_forest::RandomForestParams;
pub use registry::{RegisteredSpec, classifiers, register};
pub use spec::{CLASSIFIERS, ClassifierSpec};
pub use svm::{Gamma, Kernel, SvmParams, SvmSolver};

/// A classifier that can be fitted.
pub trait Train: Parameters + Clone {
    /// What fitting gives: for a classifier to [`register`], a [`Classify`].
    type Fitted;
    /// Fewest different classes it can learn from.
    const FEWEST_CLASSES: usize;

    /// Learns from finite `[rows, features]` and class indices `y < n_classes`, every class present.
    ///
    /// # Errors
    /// Parameters that do not fit the rows, or numbers that cannot be computed with.
    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Self::Fitted>;
}

/// A fitted classifier. The rows given are finite and have the right number of features.
pub trait Classify: Debug + Send + Sync {
    /// Features per row.
    fn n_features(&self) -> usize;

    /// Classes it was fitted on.
    fn n_classes(&self) -> usize;

    /// Probabilities `[rows, classes]`, every row summing to one.
    ///
    /// # Errors
    /// [`ModelError::NoProbability`] where the method has none.
    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>>;

    /// Class indices; the most probable, the lowest among equals, unless the method says otherwise.
    ///
    /// # Errors
    /// What the method cannot compute.
    fn predict(&self, x: ArrayView2<'_, f64>) -> Result<Vec<usize>> {
        let proba = self.predict_proba(x)?;
        Ok(proba.outer_iter().map(|row| argmax(row.iter())).collect())
    }

    /// Whether the parts fit together: asked of models read from files, whose bytes may be anyone's.
    ///
    /// # Errors
    /// [`ModelError::Inconsistent`].
    fn validate(&self) -> Result<()>;
}

/// What a model says of some rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Predicted {
    /// class index of each row
    pub classes: Vec<usize>,
    /// probabilities `[rows, classes]`; absent for classifiers without them
    pub proba: Option<Array2<f64>>,
}

impl Predicted {
    /// Joins classes with probabilities that a classifier may not have.
    pub(crate) fn new(classes: Vec<usize>, proba: Result<Array2<f64>>) -> Result<Self> {
        match proba {
            Ok(proba) => Ok(Self { classes, proba: Some(proba) }),
            Err(ModelError::NoProbability { .. }) => Ok(Self { classes, proba: None }),
            Err(error) => Err(error),
        }
    }
}

/// A fitted classifier of any kind.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Classifier {
    /// classes that had rows, ascending; the method knows them as 0, 1, …
    present: Vec<usize>,
    n_classes: usize,
    fitted: Fitted,
}

impl Classifier {
    /// Features per row.
    pub fn n_features(&self) -> usize {
        self.fitted.as_classify().n_features()
    }

    /// Classes in the label table.
    pub fn n_classes(&self) -> usize {
        self.n_classes
    }

    /// Class indices of `[rows, features]`.
    ///
    /// # Errors
    /// Another number of features than in training, or features that are not finite.
    pub fn predict(&self, x: ArrayView2<'_, f64>) -> Result<Vec<usize>> {
        check_query(x, self.n_features())?;
        let labels = self.fitted.as_classify().predict(x)?;
        let class = |c| self.present.get(c).copied();
        let classes: Option<Vec<usize>> = labels.into_iter().map(class).collect();
        classes.ok_or_else(|| ModelError::Inconsistent("a class beyond the class table".into()))
    }

    /// Probabilities `[rows, classes]`, every row summing to one.
    ///
    /// # Errors
    /// As [`Classifier::predict`]; [`ModelError::NoProbability`] for a classifier without them.
    pub fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        check_query(x, self.n_features())?;
        let known = self.fitted.as_classify().predict_proba(x)?;
        if known.dim() != (x.nrows(), self.present.len()) {
            return Err(ModelError::Inconsistent("probabilities of another shape".into()));
        }
        if self.present.len() == self.n_classes {
            return Ok(known);
        }
        let mut all = Array2::zeros((x.nrows(), self.n_classes));
        for (column, &class) in known.axis_iter(Axis(1)).zip(&self.present) {
            all.column_mut(class).assign(&column);
        }
        Ok(all)
    }

    /// Whether the parts fit together, for models read from files.
    pub(crate) fn validate(&self) -> Result<()> {
        let ascending = self.present.windows(2).all(|w| w[0] < w[1]);
        let inside = self.present.last().is_some_and(|&c| c < self.n_classes);
        // Far above any label table, far below what could exhaust memory for one row.
        let bounded = self.n_classes <= MAX_CLASSES;
        let inner = self.fitted.as_classify();
        if !(ascending && inside && bounded) || inner.n_classes() != self.present.len() {
            return Err(ModelError::Inconsistent("class table".into()));
        }
        inner.validate()
    }
}

/// Most classes a model file may have.
pub const MAX_CLASSES: usize = 1 << 16;

/// linfa's way in: the number of classes is the largest label plus one.
impl<D: Data<Elem = f64>> Fit<ArrayBase<D, Ix2>, Array1<usize>, ModelError> for ClassifierSpec {
    type Object = Classifier;

    fn fit(&self, dataset: &DatasetBase<ArrayBase<D, Ix2>, Array1<usize>>) -> Result<Classifier> {
        let y = dataset.targets.to_vec();
        let n_classes = y.iter().max().map_or(0, |c| c.saturating_add(1));
        if n_classes > MAX_CLASSES {
            let row = y.iter().position(|&c| c + 1 == n_classes).unwrap_or(0);
            return Err(ModelError::ClassOutOfRange { row, class: y[row], n_classes: MAX_CLASSES });
        }
        self.train(dataset.records.view(), &y, n_classes)
    }
}

/// linfa's way out. The result may be a refusal: of rows that are not those of the training.
impl<D: Data<Elem = f64>> PredictInplace<ArrayBase<D, Ix2>, Result<Predicted>> for Classifier {
    fn predict_inplace<'a>(&'a self, x: &'a ArrayBase<D, Ix2>, y: &mut Result<Predicted>) {
        let x = x.view();
        *y = self.predict(x).and_then(|classes| Predicted::new(classes, self.predict_proba(x)));
    }

    fn default_target(&self, _: &ArrayBase<D, Ix2>) -> Result<Predicted> {
        Ok(Predicted { classes: Vec::new(), proba: None })
    }
}
