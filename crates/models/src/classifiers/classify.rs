//! What a classifier is: something that can be fitted, and what fitting gives.

use std::fmt::Debug;

use ndarray::{Array2, ArrayView2};

use crate::error::Result;
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
    /// [`ModelError::NoProbability`](crate::ModelError::NoProbability) where the method has none.
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
    /// [`ModelError::Inconsistent`](crate::ModelError::Inconsistent).
    fn validate(&self) -> Result<()>;
}
