//! A fitted classifier of any kind.

use linfa::traits::PredictInplace;
use ndarray::{Array2, ArrayBase, ArrayView2, Axis, Data, Ix2};
use serde::{Deserialize, Serialize};

use super::Neighbours;
use super::fitted::Fitted;
use crate::error::{ModelError, Result};
use crate::table::check_query;

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
    pub(super) present: Vec<usize>,
    pub(super) n_classes: usize,
    pub(super) fitted: Fitted,
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
        Ok(self.all_columns(known))
    }

    /// `[rows, classes that had rows]` with columns of zeros for the other classes.
    fn all_columns(&self, known: Array2<f64>) -> Array2<f64> {
        if self.present.len() == self.n_classes {
            return known;
        }
        let mut all = Array2::zeros((known.nrows(), self.n_classes));
        for (column, &class) in known.axis_iter(Axis(1)).zip(&self.present) {
            all.column_mut(class).assign(&column);
        }
        all
    }

    /// Decision values of `[rows, features]`, as [`Classify::decision_function`](super::Classify::decision_function); a class without
    /// rows in training is one below the lowest of the row.
    ///
    /// # Errors
    /// As [`Classifier::predict`]; [`ModelError::Lacks`] for a classifier without them.
    pub fn decision_function(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        check_query(x, self.n_features())?;
        let known = self.fitted.as_classify().decision_function(x)?;
        let of_two = self.present.len() == 2;
        if known.dim() != (x.nrows(), if of_two { 1 } else { self.present.len() }) {
            return Err(ModelError::Inconsistent("decision values of another shape".into()));
        }
        if self.present.len() == self.n_classes {
            return Ok(known);
        }
        let mut all = Array2::zeros((x.nrows(), self.n_classes));
        for (mut all, known) in all.outer_iter_mut().zip(known.outer_iter()) {
            let row = if of_two { vec![-known[0], known[0]] } else { known.to_vec() };
            all.fill(row.iter().copied().fold(f64::INFINITY, f64::min) - 1.0);
            row.iter().zip(&self.present).for_each(|(&value, &class)| all[class] = value);
        }
        Ok(all)
    }

    /// The `k` nearest training rows of each row of `x`, or of each training row among the others.
    ///
    /// # Errors
    /// As [`Classifier::predict`]; [`ModelError::Lacks`] for any but `knn`.
    pub fn neighbours(&self, x: Option<ArrayView2<'_, f64>>, k: usize) -> Result<Neighbours> {
        if let Some(x) = x {
            check_query(x, self.n_features())?;
        }
        self.fitted.as_classify().neighbours(x, k)
    }

    /// See [`Classify::feature_importances`](super::Classify::feature_importances).
    pub fn feature_importances(&self) -> Option<&[f64]> {
        self.fitted.as_classify().feature_importances()
    }

    /// See [`Classify::out_of_bag`](super::Classify::out_of_bag); classes without rows have zeros.
    pub fn out_of_bag(&self) -> Option<Array2<f64>> {
        self.fitted.as_classify().out_of_bag().map(|known| self.all_columns(known.to_owned()))
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
