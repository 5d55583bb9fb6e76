//! What a classifier is: something that can be fitted, and what fitting gives.

use std::fmt::Debug;

use ndarray::{ArcArray2, Array2, ArrayView2};

use crate::error::{ModelError, Result};
use crate::params::Parameters;
use crate::table::argmax;

/// A classifier that can be fitted.
pub trait Train: Parameters + Clone {
    /// What fitting gives: for a classifier to [`register`](super::register), a [`Classify`].
    type Fitted;
    /// Fewest different classes it can learn from.
    const FEWEST_CLASSES: usize;

    /// Learns from finite `[rows, features]` and class indices `y < n_classes`, every class present.
    ///
    /// # Errors
    /// Parameters that do not fit the rows, or numbers that cannot be computed with.
    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Self::Fitted>;

    /// The same of rows that a method may keep as they are, without a copy.
    ///
    /// # Errors
    /// As [`Train::train`].
    fn train_shared(
        &self,
        x: &ArcArray2<f64>,
        y: &[usize],
        n_classes: usize,
    ) -> Result<Self::Fitted> {
        self.train(x.view(), y, n_classes)
    }

    /// The same where rows count more or less: `weights` has a positive number for each.
    ///
    /// # Errors
    /// As [`Train::train`]; [`ModelError::Lacks`] for a method to which rows count alike.
    fn train_weighted(
        &self,
        _x: ArrayView2<'_, f64>,
        _y: &[usize],
        _n_classes: usize,
        _weights: &[f64],
    ) -> Result<Self::Fitted> {
        Err(ModelError::Lacks {
            what: "sample weights",
            which: "svm and tree (both with solver=own), rf, et and logistic take them",
        })
    }
}

/// Training rows that are near to others.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    /// `[rows, k]`, nearest first
    pub distances: Array2<f64>,
    /// numbers of training rows, `[rows, k]`
    pub rows: Array2<usize>,
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

    /// Decision values `[rows, classes]`, the largest of a row being its class; of two classes
    /// `[rows, 1]`, positive for the second one.
    ///
    /// # Errors
    /// [`ModelError::Lacks`] where the method has none.
    fn decision_function(&self, _: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        Err(ModelError::Lacks { what: "decision function", which: "svm and logistic have one" })
    }

    /// The `k` nearest training rows of each row of `x`, or of each training row among the others.
    ///
    /// # Errors
    /// [`ModelError::Lacks`] where the method has none, or a `k` beyond the training rows.
    fn neighbours(&self, _x: Option<ArrayView2<'_, f64>>, _k: usize) -> Result<Neighbours> {
        Err(ModelError::Lacks { what: "neighbours", which: "knn has them" })
    }

    /// How much each feature told the classes apart in training, summing to one (Breiman 2001: mean
    /// decrease of impurity). Forests know it after training; files do not hold it.
    fn feature_importances(&self) -> Option<&[f64]> {
        None
    }

    /// Class fractions `[training rows, classes]` by the trees of a forest that did not see the row,
    /// NaN where all did. Known after training that was asked for it; files do not hold it.
    fn out_of_bag(&self) -> Option<ArrayView2<'_, f64>> {
        None
    }

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
