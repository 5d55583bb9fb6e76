//! A classifier's name with its parameters.

use linfa::DatasetBase;
use linfa::traits::Fit;
use ndarray::{ArcArray2, Array1, ArrayBase, ArrayView2, Axis, Data, Ix2};
use serde::de::{DeserializeOwned, Error as _};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

use super::decision_tree::DecisionTreeParams;
use super::extra_trees::ExtraTreesParams;
use super::fitted::Fitted;
use super::knn::KNearestParams;
use super::logistic::LogisticParams;
use super::random_forest::RandomForestParams;
use super::registry::{self, RegisteredSpec};
use super::svm::SvmParams;
use super::{Classifier, Classify, MAX_CLASSES, Train};
use crate::error::{ModelError, Result};
use crate::params::{Parameter, Parameters, key_of};
use crate::table::{check_features, check_labels, check_varied, check_weights, class_counts};

/// What other programs call a classifier, by its name here.
fn usual(name: &str) -> &str {
    match name.to_lowercase().replace(['-', '_', ' '], "").as_str() {
        "forest" | "randomforest" | "randomforestclassifier" => "rf",
        "svc" | "supportvector" | "supportvectormachine" => "svm",
        "decisiontree" | "decisiontreeclassifier" | "cart" => "tree",
        "extratreesclassifier" => "extra-trees",
        "kneighborsclassifier" | "nearestneighbors" | "nn" => "knn",
        _ => name,
    }
}

macro_rules! built_in {
    ($($variant:ident, $name:literal, $params:ident => $fitted:path, $about:literal;)*) => {
        /// A classifier's name with its parameters.
        #[derive(Clone, Debug, PartialEq)]
        pub enum ClassifierSpec {
            $(#[doc = $about] $variant($params),)*
            /// one that [`register`](super::register) added
            Registered(RegisteredSpec),
        }

        /// Names and descriptions of the classifiers that come with the crate;
        /// [`classifiers`](super::classifiers) lists registered ones too.
        pub const CLASSIFIERS: &[(&str, &str)] = &[$(($name, $about)),*];

        impl ClassifierSpec {
            /// The classifier of this name, its parameters from a JSON object.
            ///
            /// # Errors
            /// Unknown name, unknown parameter, impossible value.
            pub fn new(name: &str, parameters: &Map<String, Value>) -> Result<Self> {
                match name {
                    $($name => Ok(Self::$variant($params::from_json(parameters)?)),)*
                    _ => match registry::find(name) {
                        Some(kind) => Ok(Self::Registered(kind.spec(parameters)?)),
                        None => Err(ModelError::UnknownName {
                            kind: "classifier",
                            name: name.into(),
                            allowed: corsmal_names::choices(usual(name), classifiers().into_iter().map(|(name, _)| name)),
                        }),
                    },
                }
            }

            /// Its name.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$variant(_) => $name,)*
                    Self::Registered(spec) => spec.name(),
                }
            }

            /// Its parameters as listed to people.
            pub fn table(&self) -> &'static [Parameter] {
                match self {
                    $(Self::$variant(_) => <$params as Parameters>::TABLE,)*
                    Self::Registered(spec) => spec.table(),
                }
            }

            /// All parameters, defaults included.
            pub fn parameters(&self) -> Map<String, Value> {
                match self {
                    $(Self::$variant(p) => p.values(),)*
                    Self::Registered(spec) => spec.parameters().clone(),
                }
            }

            /// The parameters that model files hold: those that came after version 0.1.0 only where
            /// they are not at their default.
            fn stored(&self) -> Value {
                let stored = match self {
                    $(Self::$variant(p) => serde_json::to_value(p),)*
                    Self::Registered(spec) => Ok(Value::Object(spec.parameters().clone())),
                };
                stored.unwrap_or_default()
            }

            fn fit_present(
                &self,
                (x, shared): (ArrayView2<'_, f64>, Option<&ArcArray2<f64>>),
                y: &[usize],
                n: usize,
                weights: Option<&[f64]>,
            ) -> Result<Fitted> {
                let fewest = match self {
                    $(Self::$variant(p) => {
                        p.check()?;
                        <$params as Train>::FEWEST_CLASSES
                    })*
                    Self::Registered(spec) => spec.fewest_classes(),
                };
                if n < fewest {
                    return Err(ModelError::TooFewClasses {
                        owner: self.name(), rows: y.len(), classes: n,
                    });
                }
                match self {
                    $(Self::$variant(p) => match (weights, shared) {
                        (None, None) => p.train(x, y, n),
                        (None, Some(shared)) => p.train_shared(shared, y, n),
                        (Some(weights), _) => p.train_weighted(x, y, n, weights),
                    }.map($fitted),)*
                    Self::Registered(spec) => spec.train(x, y, n, weights).map(Fitted::Registered),
                }
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

built_in! {
    KNearest, "knn", KNearestParams => Fitted::of_neighbours, "k nearest neighbours";
    Svm, "svm", SvmParams => Fitted::Svm, "support vector machine, one-vs-one";
    DecisionTree, "tree", DecisionTreeParams => Fitted::of_tree, "decision tree (CART)";
    RandomForest, "rf", RandomForestParams => Fitted::RandomForest, "random forest";
    ExtraTrees, "et", ExtraTreesParams => Fitted::ExtraTrees, "extremely randomised trees";
    Logistic, "logistic", LogisticParams => Fitted::Logistic, "logistic regression (multinomial, L2)";
}

/// Names and descriptions of all classifiers, registered ones last.
pub fn classifiers() -> Vec<(&'static str, &'static str)> {
    CLASSIFIERS.iter().copied().chain(registry::registered()).collect()
}

/// Adds a classifier to those that [`ClassifierSpec::new`] knows, by the name
/// [`OWNER`](Parameters::OWNER); `about` is one line for people. A program that reads model files
/// with it registers it first, under the same name.
///
/// # Errors
/// [`ModelError::NameTaken`].
pub fn register<P>(about: &'static str) -> Result<()>
where
    P: Train,
    P::Fitted: Classify + Serialize + DeserializeOwned + 'static,
{
    if CLASSIFIERS.iter().any(|(name, _)| *name == P::OWNER) {
        return Err(ModelError::NameTaken { name: P::OWNER });
    }
    registry::add::<P>(about)
}

impl ClassifierSpec {
    /// The classifier of this name with default parameters.
    ///
    /// # Errors
    /// Unknown name.
    pub fn named(name: &str) -> Result<Self> {
        Self::new(name, &Map::new())
    }

    /// The parameter that a user's word stands for: scikit-learn's names are understood.
    pub fn key<'a>(&self, word: &'a str) -> &'a str {
        key_of(self.table(), word)
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
        self.train_weighted(x, y, n_classes, None)
    }

    /// The same where rows count more or less: `weights` has a number for each, and a row of weight
    /// zero is left out.
    ///
    /// # Errors
    /// As [`ClassifierSpec::train`]; weights that are negative, not finite or not one for each row,
    /// or a classifier that takes none.
    pub fn train_weighted(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<Classifier> {
        if let Some(weights) = weights {
            check_weights(x.nrows(), weights)?;
            let rows: Vec<usize> = (0..weights.len()).filter(|&row| weights[row] > 0.0).collect();
            if rows.len() < weights.len() {
                check_labels(x.nrows(), y, n_classes)?;
                let y: Vec<usize> = rows.iter().map(|&row| y[row]).collect();
                let weights: Vec<f64> = rows.iter().map(|&row| weights[row]).collect();
                let x = x.select(Axis(0), &rows);
                return self.train_weighted(x.view(), &y, n_classes, Some(&weights));
            }
        }
        self.train_rows((x, None), y, n_classes, weights)
    }

    /// As [`ClassifierSpec::train`], of rows that the classifier may keep without a copy.
    ///
    /// # Errors
    /// As [`ClassifierSpec::train`].
    pub fn train_shared(
        &self,
        x: &ArcArray2<f64>,
        y: &[usize],
        n_classes: usize,
    ) -> Result<Classifier> {
        self.train_rows((x.view(), Some(x)), y, n_classes, None)
    }

    fn train_rows(
        &self,
        (x, shared): (ArrayView2<'_, f64>, Option<&ArcArray2<f64>>),
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
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
        let fitted = spec.fit_present((x, shared), &compact, present.len(), weights)?;
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

/// `{"name": …, "parameters": {…}}`
impl Serialize for ClassifierSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("ClassifierSpec", 2)?;
        object.serialize_field("name", self.name())?;
        object.serialize_field("parameters", &self.stored())?;
        object.end()
    }
}

impl<'de> Deserialize<'de> for ClassifierSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Named {
            name: String,
            parameters: Map<String, Value>,
        }
        let Named { name, parameters } = Named::deserialize(deserializer)?;
        Self::new(&name, &parameters).map_err(D::Error::custom)
    }
}
