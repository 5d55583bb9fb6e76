//! Steps followed by a classifier.

use linfa::DatasetBase;
use linfa::traits::{Fit, PredictInplace};
use ndarray::{Array2, ArrayBase, ArrayView2, CowArray, Data, Ix2};
use serde::{Deserialize, Serialize};

use crate::classifiers::{Classifier, ClassifierSpec, Neighbours, Predicted};
use crate::error::{ModelError, Result};
use crate::steps::{Prepared, Step, StepSpec, through};
use crate::table::{check_features, check_labels, check_query};
use crate::targets::Classes;

/// What is trained: steps, then a classifier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PipelineSpec {
    /// steps in order
    #[serde(default)]
    pub steps: Vec<StepSpec>,
    /// the classifier
    pub classifier: ClassifierSpec,
}

impl PipelineSpec {
    /// A classifier after standardisation.
    pub fn standardized(classifier: impl Into<ClassifierSpec>) -> Self {
        Self {
            steps: vec![StepSpec::Standardize(Default::default())],
            classifier: classifier.into(),
        }
    }

    /// A classifier alone.
    pub fn plain(classifier: impl Into<ClassifierSpec>) -> Self {
        Self { steps: Vec::new(), classifier: classifier.into() }
    }

    /// Fits every step and the classifier on `[rows, features]` and class indices below `n_classes`.
    ///
    /// # Errors
    /// Whatever a step or the classifier refuses.
    pub fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Pipeline> {
        self.train_weighted(x, y, n_classes, None)
    }

    /// The same where rows count more or less to the classifier (see
    /// [`ClassifierSpec::train_weighted`]); to steps they count alike.
    ///
    /// # Errors
    /// Whatever a step or the classifier refuses.
    pub fn train_weighted(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<Pipeline> {
        if !self.steps.is_empty() {
            check_features(x)?;
            check_labels(x.nrows(), y, n_classes)?;
        }
        let prepared = Prepared::fit(&self.steps, x)?;
        let classifier = prepared.train_weighted(&self.classifier, y, n_classes, weights)?;
        Ok(Pipeline { steps: prepared.into_steps(), classifier })
    }
}

impl<D: Data<Elem = f64>> Fit<ArrayBase<D, Ix2>, Classes, ModelError> for PipelineSpec {
    type Object = Pipeline;

    fn fit(&self, dataset: &DatasetBase<ArrayBase<D, Ix2>, Classes>) -> Result<Pipeline> {
        let classes = &dataset.targets;
        self.train(dataset.records.view(), &classes.indices().to_vec(), classes.n_classes())
    }
}

/// Fitted steps and classifier.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pipeline {
    steps: Vec<Step>,
    classifier: Classifier,
}

impl Pipeline {
    /// A classifier after the steps whose results it was trained on.
    ///
    /// # Errors
    /// [`ModelError::Inconsistent`] where one part gives another number of features than the next
    /// takes.
    pub fn new(steps: Vec<Step>, classifier: Classifier) -> Result<Self> {
        let pipeline = Self { steps, classifier };
        pipeline.check_joints()?;
        Ok(pipeline)
    }

    /// Features per row.
    pub fn n_features(&self) -> usize {
        self.steps.first().map_or_else(|| self.classifier.n_features(), Step::n_inputs)
    }

    /// Classes in the label table.
    pub fn n_classes(&self) -> usize {
        self.classifier.n_classes()
    }

    /// Fitted steps in order.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// `[rows, features]` through all steps; what comes out is checked by the classifier.
    fn through_steps<'a>(&self, x: ArrayView2<'a, f64>) -> Result<CowArray<'a, f64, Ix2>> {
        if !self.steps.is_empty() {
            check_query(x, self.n_features())?;
        }
        through(&self.steps, x)
    }

    /// Class indices of `[rows, features]`.
    ///
    /// # Errors
    /// Another number of features than in training, or features that are not finite.
    pub fn predict(&self, x: ArrayView2<'_, f64>) -> Result<Vec<usize>> {
        self.classifier.predict(self.through_steps(x)?.view())
    }

    /// Probabilities `[rows, classes]`.
    ///
    /// # Errors
    /// As [`Pipeline::predict`]; [`ModelError::NoProbability`] for an SVM trained without.
    pub fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        self.classifier.predict_proba(self.through_steps(x)?.view())
    }

    /// Decision values of `[rows, features]`: see [`Classifier::decision_function`].
    ///
    /// # Errors
    /// As [`Pipeline::predict`]; [`ModelError::Lacks`] for a
    /// classifier without them.
    pub fn decision_function(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        self.classifier.decision_function(self.through_steps(x)?.view())
    }

    /// The `k` nearest training rows, after the steps: see [`Classifier::neighbours`].
    ///
    /// # Errors
    /// As [`Pipeline::predict`]; [`ModelError::Lacks`] for any but
    /// `knn`.
    pub fn neighbours(&self, x: Option<ArrayView2<'_, f64>>, k: usize) -> Result<Neighbours> {
        let x = x.map(|x| self.through_steps(x)).transpose()?;
        self.classifier.neighbours(x.as_ref().map(|x| x.view()), k)
    }

    /// The classifier after the steps.
    pub fn classifier(&self) -> &Classifier {
        &self.classifier
    }

    /// Whether the parts fit together, for models read from files.
    pub(crate) fn validate(&self) -> Result<()> {
        self.steps.iter().try_for_each(Step::validate)?;
        self.classifier.validate()?;
        self.check_joints()
    }

    fn check_joints(&self) -> Result<()> {
        let joined = self.steps.windows(2).all(|w| w[0].n_outputs() == w[1].n_inputs());
        let last = self.steps.last().is_none_or(|s| s.n_outputs() == self.classifier.n_features());
        if joined && last { Ok(()) } else { Err(ModelError::Inconsistent("pipeline".into())) }
    }
}

impl<D: Data<Elem = f64>> PredictInplace<ArrayBase<D, Ix2>, Result<Predicted>> for Pipeline {
    fn predict_inplace<'a>(&'a self, x: &'a ArrayBase<D, Ix2>, y: &mut Result<Predicted>) {
        *y = self
            .through_steps(x.view())
            .and_then(|x| linfa::traits::Predict::predict(&self.classifier, &x));
    }

    fn default_target(&self, _: &ArrayBase<D, Ix2>) -> Result<Predicted> {
        Ok(Predicted { classes: Vec::new(), proba: None })
    }
}
