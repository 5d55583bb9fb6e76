//! Training rows after steps that were fitted on them.

use ndarray::{ArcArray2, Array2, ArrayView2, CowArray, Ix2};

use super::{Step, StepSpec};
use crate::classifiers::{Classifier, ClassifierSpec};
use crate::error::Result;

/// Rows `[rows, features]` through all `steps` in order.
///
/// # Errors
/// Another number of features than in training, or features that are not finite.
pub fn through<'a>(steps: &[Step], x: ArrayView2<'a, f64>) -> Result<CowArray<'a, f64, Ix2>> {
    let mut current = CowArray::from(x);
    for step in steps {
        current = step.transform(current.view())?.into();
    }
    Ok(current)
}

/// Fitted steps with the training rows after them: made once, for every classifier that follows.
#[derive(Clone, Debug)]
pub struct Prepared<'a> {
    steps: Vec<Step>,
    rows: Rows<'a>,
}

#[derive(Clone, Debug)]
enum Rows<'a> {
    Given(ArrayView2<'a, f64>),
    /// Classifiers share what steps have made.
    Made(ArcArray2<f64>),
}

impl<'a> Prepared<'a> {
    /// Fits every step on what the one before it gives.
    ///
    /// # Errors
    /// Whatever a step refuses.
    pub fn fit(specs: &[StepSpec], x: ArrayView2<'a, f64>) -> Result<Self> {
        let mut steps = Vec::with_capacity(specs.len());
        let mut made: Option<Array2<f64>> = None;
        for spec in specs {
            let rows = made.as_ref().map_or(x.view(), |made| made.view());
            let step = spec.fit(rows)?;
            let next = step.transform(rows)?;
            steps.push(step);
            made = Some(next);
        }
        let rows = made.map_or(Rows::Given(x), |made| Rows::Made(made.into_shared()));
        Ok(Self { steps, rows })
    }

    /// The fitted steps.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// A classifier of the training rows after the steps.
    ///
    /// # Errors
    /// As [`ClassifierSpec::train`].
    pub fn train(
        &self,
        classifier: &ClassifierSpec,
        y: &[usize],
        n_classes: usize,
    ) -> Result<Classifier> {
        match &self.rows {
            Rows::Given(rows) => classifier.train(*rows, y, n_classes),
            Rows::Made(rows) => classifier.train_shared(rows, y, n_classes),
        }
    }

    /// The same where rows count more or less to the classifier.
    ///
    /// # Errors
    /// As [`ClassifierSpec::train_weighted`].
    pub fn train_weighted(
        &self,
        classifier: &ClassifierSpec,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<Classifier> {
        if weights.is_none() {
            return self.train(classifier, y, n_classes);
        }
        let rows = match &self.rows {
            Rows::Given(rows) => rows.view(),
            Rows::Made(rows) => rows.view(),
        };
        classifier.train_weighted(rows, y, n_classes, weights)
    }

    /// The fitted steps alone.
    pub fn into_steps(self) -> Vec<Step> {
        self.steps
    }
}
