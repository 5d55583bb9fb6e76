//! Classifiers that are registered while the program runs, and models that are stored by name.

use std::fmt;
use std::sync::{Arc, PoisonError, RwLock};

use ndarray::ArrayView2;
use serde::de::{DeserializeOwned, Error as _};
use serde::ser::{Error as _, SerializeTuple};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Classify, Train, decision_tree, knn};
use crate::error::{ModelError, Result};
use crate::params::{Parameter, Values};

/// Trains with parameters on rows, labels, a number of classes and weights of the rows.
type TrainWith =
    fn(&Values, ArrayView2<'_, f64>, &[usize], usize, Option<&[f64]>) -> Result<Registered>;

/// What is known of a registered classifier.
pub(super) struct Kind {
    name: &'static str,
    about: &'static str,
    table: &'static [Parameter],
    fewest_classes: usize,
    check: fn(&Values) -> Result<Values>,
    train: TrainWith,
    read: fn(&[u8]) -> Result<Registered>,
}

static KINDS: RwLock<Vec<&'static Kind>> = RwLock::new(Vec::new());

/// Adds a classifier of another crate, by the name [`OWNER`](crate::params::Parameters::OWNER).
///
/// # Errors
/// [`ModelError::NameTaken`] for the name of another one, or of a model that is stored by name.
pub(super) fn add<P>(about: &'static str) -> Result<()>
where
    P: Train,
    P::Fitted: Classify + Serialize + DeserializeOwned + 'static,
{
    let name = P::OWNER;
    let mut kinds = KINDS.write().unwrap_or_else(PoisonError::into_inner);
    let reserved = [decision_tree::STORED_NAME, knn::STORED_NAME];
    if reserved.into_iter().chain(kinds.iter().map(|kind| kind.name)).any(|taken| taken == name) {
        return Err(ModelError::NameTaken { name });
    }
    // Kept for the life of the program, as the table of the built-in ones is.
    kinds.push(Box::leak(Box::new(Kind {
        name,
        about,
        table: P::TABLE,
        fewest_classes: P::FEWEST_CLASSES,
        check: |given| Ok(P::from_json(given)?.values()),
        train: |parameters, x, y, n_classes, weights| {
            let parameters = P::from_json(parameters)?;
            let fitted = match weights {
                None => parameters.train(x, y, n_classes)?,
                Some(weights) => parameters.train_weighted(x, y, n_classes, weights)?,
            };
            Ok(Registered::new(P::OWNER, fitted))
        },
        read: |bytes| Registered::read_as::<P::Fitted>(P::OWNER, bytes),
    })));
    Ok(())
}

/// Names and descriptions of the registered classifiers.
pub(super) fn registered() -> Vec<(&'static str, &'static str)> {
    let kinds = KINDS.read().unwrap_or_else(PoisonError::into_inner);
    kinds.iter().map(|kind| (kind.name, kind.about)).collect()
}

pub(super) fn find(name: &str) -> Option<&'static Kind> {
    let kinds = KINDS.read().unwrap_or_else(PoisonError::into_inner);
    kinds.iter().find(|kind| kind.name == name).copied()
}

impl Kind {
    pub(super) fn spec(&'static self, parameters: &Values) -> Result<RegisteredSpec> {
        Ok(RegisteredSpec { kind: self, parameters: (self.check)(parameters)? })
    }
}

/// A registered classifier with its parameters.
#[derive(Clone)]
pub struct RegisteredSpec {
    kind: &'static Kind,
    parameters: Values,
}

impl RegisteredSpec {
    pub(super) fn name(&self) -> &'static str {
        self.kind.name
    }

    pub(super) fn table(&self) -> &'static [Parameter] {
        self.kind.table
    }

    pub(super) fn parameters(&self) -> &Values {
        &self.parameters
    }

    pub(super) fn fewest_classes(&self) -> usize {
        self.kind.fewest_classes
    }

    pub(super) fn train(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<Registered> {
        (self.kind.train)(&self.parameters, x, y, n_classes, weights)
    }
}

impl fmt::Debug for RegisteredSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple(self.kind.name).field(&self.parameters).finish()
    }
}

impl PartialEq for RegisteredSpec {
    fn eq(&self, other: &Self) -> bool {
        self.kind.name == other.kind.name && self.parameters == other.parameters
    }
}

/// A fitted classifier that can be written.
trait Stored: Classify {
    fn bytes(&self) -> postcard::Result<Vec<u8>>;
    fn as_classify(&self) -> &dyn Classify;
}

impl<F: Classify + Serialize> Stored for F {
    fn bytes(&self) -> postcard::Result<Vec<u8>> {
        postcard::to_stdvec(self)
    }

    fn as_classify(&self) -> &dyn Classify {
        self
    }
}

/// A fitted classifier that is stored by name: of a registered kind, or of a solver that came after
/// the format of model files.
#[derive(Clone, Debug)]
pub(super) struct Registered {
    name: &'static str,
    model: Arc<dyn Stored>,
}

impl Registered {
    pub(super) fn new(name: &'static str, model: impl Classify + Serialize + 'static) -> Self {
        Self { name, model: Arc::new(model) }
    }

    pub(super) fn as_classify(&self) -> &dyn Classify {
        self.model.as_classify()
    }

    fn read_as<F>(name: &'static str, bytes: &[u8]) -> Result<Self>
    where
        F: Classify + Serialize + DeserializeOwned + 'static,
    {
        let refuse = |reason: String| Err(ModelError::Inconsistent(format!("{name}: {reason}")));
        match postcard::take_from_bytes::<F>(bytes) {
            Ok((model, [])) => Ok(Self::new(name, model)),
            Ok((_, rest)) => refuse(format!("{} bytes left over", rest.len())),
            Err(error) => refuse(error.to_string()),
        }
    }

    fn read(name: &str, bytes: &[u8]) -> Result<Self> {
        match name {
            decision_tree::STORED_NAME => {
                Self::read_as::<decision_tree::LinfaTree>(decision_tree::STORED_NAME, bytes)
            }
            knn::STORED_NAME => Self::read_as::<knn::LinfaNeighbours>(knn::STORED_NAME, bytes),
            _ => match find(name) {
                Some(kind) => (kind.read)(bytes),
                None => Err(ModelError::Inconsistent(format!(
                    "the classifier {name:?} is not registered in this program"
                ))),
            },
        }
    }
}

/// Name, then the model's own bytes.
impl Serialize for Registered {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let bytes = self.model.bytes().map_err(S::Error::custom)?;
        let mut pair = serializer.serialize_tuple(2)?;
        pair.serialize_element(self.name)?;
        pair.serialize_element(&bytes)?;
        pair.end()
    }
}

impl<'de> Deserialize<'de> for Registered {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let (name, bytes) = <(String, Vec<u8>)>::deserialize(deserializer)?;
        Self::read(&name, &bytes).map_err(D::Error::custom)
    }
}
