//! The classifiers, and the table that names them.
//!
//! Adding one: a file here with a parameter struct (`parameters!`), a fitted type implementing
//! [`Classify`], and [`Train`] for the parameters; then one line in the `registry!` below (at its
//! end: model files store the position).

use linfa::DatasetBase;
use linfa::traits::{Fit, PredictInplace};
use ndarray::{Array1, Array2, ArrayBase, ArrayView2, Axis, Data, Ix2};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{ModelError, Result};
use crate::params::{Parameter, Parameters};
use crate::table::{argmax, check_features, check_labels, check_query, check_varied, class_counts};

/// A classifier that can be fitted.
pub(crate) trait Train: Parameters {
    /// What fitting gives.
    type Fitted: Classify;
    /// Fewest different classes it can learn from.
    const FEWEST_CLASSES: usize;

    /// Learns from finite `[rows, features]` and class indices `y < n_classes`, every class present.
    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Self::Fitted>;
}

/// A fitted classifier. The rows given are finite and have the right number of features.
pub(crate) trait Classify {
    /// Features per row.
    fn n_features(&self) -> usize;
    /// Classes it was fitted on.
    fn n_classes(&self) -> usize;
    /// Probabilities `[rows, classes]`.
    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>>;
    /// Class indices; the most probable, the lowest among equals, unless the method says otherwise.
    fn predict(&self, x: ArrayView2<'_, f64>) -> Result<Vec<usize>> {
        let proba = self.predict_proba(x)?;
        Ok(proba.outer_iter().map(|row| argmax(row.iter())).collect())
    }
    /// Whether the parts fit together, for models read from files.
    fn validate(&self) -> Result<()>;
}

macro_rules! registry {
    ($($module:ident: $variant:ident, $name:literal, $params:ident, $fitted:ident, $about:literal;)*) => {
        $(
            mod $module;
            pub use $module::$params;
        )*

        /// A classifier's name with its parameters.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "name", content = "parameters")]
        pub enum ClassifierSpec {
            $(#[doc = $about] #[serde(rename = $name)] $variant($params),)*
        }

        #[derive(Clone, Debug, Serialize, Deserialize)]
        enum Fitted {
            $($variant($module::$fitted),)*
        }

        /// Names and descriptions of all classifiers.
        pub const CLASSIFIERS: &[(&str, &str)] = &[$(($name, $about)),*];

        impl ClassifierSpec {
            /// The classifier of this name, its parameters from a JSON object.
            ///
            /// # Errors
            /// Unknown name, unknown parameter, impossible value.
            pub fn new(name: &str, parameters: &Map<String, Value>) -> Result<Self> {
                match name {
                    $($name => Ok(Self::$variant($params::from_json(parameters)?)),)*
                    _ => Err(ModelError::UnknownName {
                        kind: "classifier",
                        name: name.into(),
                        allowed: CLASSIFIERS.iter().map(|c| c.0).collect::<Vec<_>>().join(", "),
                    }),
                }
            }

            /// Its name.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => $name,)* }
            }

            /// Its parameters as listed to people.
            pub fn table(&self) -> &'static [Parameter] {
                match self { $(Self::$variant(_) => <$params as Parameters>::TABLE,)* }
            }

            /// All parameters, defaults included.
            pub fn parameters(&self) -> Map<String, Value> {
                let value = match self { $(Self::$variant(p) => serde_json::to_value(p),)* };
                match value {
                    Ok(Value::Object(map)) => map,
                    _ => Map::new(),
                }
            }

            fn fit_present(&self, x: ArrayView2<'_, f64>, y: &[usize], n: usize) -> Result<Fitted> {
                match self { $(Self::$variant(p) => {
                    p.check()?;
                    if n < <$params as Train>::FEWEST_CLASSES {
                        return Err(ModelError::TooFewClasses {
                            owner: $name, rows: y.len(), classes: n,
                        });
                    }
                    p.train(x, y, n).map(Fitted::$variant)
                })* }
            }
        }

        impl Fitted {
            fn as_classify(&self) -> &dyn Classify {
                match self { $(Self::$variant(m) => m,)* }
            }
        }

        $(
            impl From<$params> for ClassifierSpec {
                fn from(params: $params) -> Self {
                    Self::$variant(params)
                }
            }

            impl<D: Data<Elem = f64>> Fit<ArrayBase<D, Ix2>, Array1<usize>, ModelError> for $params {
                type Object = Classifier;

                fn fit(
                    &self,
                    dataset: &DatasetBase<ArrayBase<D, Ix2>, Array1<usize>>,
                ) -> Result<Classifier> {
                    ClassifierSpec::from(self.clone()).fit(dataset)
                }
            }
        )*
    };
}

registry! {
    knn: KNearest, "knn", KNearestParams, KNearest, "k nearest neighbours";
    svm: Svm, "svm", SvmParams, Svm, "support vector machine, one against one";
    decision_tree: DecisionTree, "tree", DecisionTreeParams, DecisionTree, "decision tree (CART)";
    random_forest: RandomForest, "rf", RandomForestParams, RandomForest, "random forest";
    extra_trees: ExtraTrees, "et", ExtraTreesParams, ExtraTrees, "extremely randomised trees";
    logistic: Logistic, "logistic", LogisticParams, Logistic, "logistic regression (multinomial, L2)";
}

mod cart;
mod trees;

pub use cart::{Criterion, MaxFeatures};
pub use knn::{Metric, Weights};
pub use svm::{Gamma, Kernel};

impl ClassifierSpec {
    /// The classifier of this name with default parameters.
    ///
    /// # Errors
    /// Unknown name.
    pub fn named(name: &str) -> Result<Self> {
        Self::new(name, &Map::new())
    }

    /// Learns from `[rows, features]` and class indices below `n_classes`. Classes without rows
    /// are allowed: they get probability zero.
    ///
    /// # Errors
    /// Impossible parameters, features that are not finite, labels that do not match, too few
    /// classes.
    pub fn train(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
    ) -> Result<Classifier> {
        check_features(x)?;
        check_labels(x.nrows(), y, n_classes)?;
        check_varied(x)?;
        let counts = class_counts(y, n_classes);
        let present: Vec<usize> = (0..n_classes).filter(|&c| counts[c] > 0).collect();
        let mut position = vec![0; n_classes];
        present.iter().enumerate().for_each(|(i, &c)| position[c] = i);
        let compact: Vec<usize> = y.iter().map(|&c| position[c]).collect();
        let spec = self.for_classes(&present, n_classes)?;
        let fitted = spec.fit_present(x, &compact, present.len())?;
        Ok(Classifier { present, n_classes, fitted })
    }

    /// The same with explicit class weights restricted to the classes that have rows.
    fn for_classes(&self, present: &[usize], n_classes: usize) -> Result<Self> {
        let mut parameters = self.parameters();
        match parameters.get_mut("class_weight") {
            Some(Value::Array(weights)) if weights.len() != n_classes => Err(ModelError::Length {
                what: "class_weight",
                expected: n_classes,
                actual: weights.len(),
            }),
            Some(Value::Array(weights)) => {
                *weights = present.iter().map(|&c| weights[c].clone()).collect();
                Self::new(self.name(), &parameters)
            }
            _ => Ok(self.clone()),
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
        Ok(labels.into_iter().map(|c| self.present[c]).collect())
    }

    /// Probabilities `[rows, classes]`, every row summing to one.
    ///
    /// # Errors
    /// As [`Classifier::predict`]; [`ModelError::NoProbability`] for an SVM trained without.
    pub fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        check_query(x, self.n_features())?;
        let known = self.fitted.as_classify().predict_proba(x)?;
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

/// linfa's way out.
///
/// # Panics
/// Where [`Classifier::predict`] gives an error: linfa's trait has no room for one.
impl<D: Data<Elem = f64>> PredictInplace<ArrayBase<D, Ix2>, Array1<usize>> for Classifier {
    fn predict_inplace<'a>(&'a self, x: &'a ArrayBase<D, Ix2>, y: &mut Array1<usize>) {
        let labels = self.predict(x.view()).unwrap_or_else(|e| panic!("{e}"));
        y.assign(&Array1::from(labels));
    }

    fn default_target(&self, x: &ArrayBase<D, Ix2>) -> Array1<usize> {
        Array1::zeros(x.nrows())
    }
}
