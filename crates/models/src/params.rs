//! Parameter tables: one place per classifier or step says which keys it has, their defaults and
//! what they may be. From it come the checked struct, the error texts and the listings.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{ModelError, Result};

/// One parameter as listed to people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// key
    pub key: &'static str,
    /// what it may be
    pub allowed: &'static str,
    /// what it does
    pub help: &'static str,
}

/// A struct of parameters with a name, keys and ranges.
pub trait Parameters: Default + Serialize + DeserializeOwned {
    /// Name of the classifier or step.
    const OWNER: &'static str;
    /// Its parameters.
    const TABLE: &'static [Parameter];

    /// Refuses values outside their ranges.
    ///
    /// # Errors
    /// [`ModelError::ParameterValue`] naming key, value and what is allowed.
    fn check(&self) -> Result<()>;

    /// Every parameter with its value, in the order of the table.
    fn values(&self) -> Map<String, Value>;

    /// From a JSON object; keys left out keep their defaults, and scikit-learn's names of keys are
    /// understood ([`SKLEARN_NAMES`]).
    ///
    /// # Errors
    /// [`ModelError::UnknownParameter`] or [`ModelError::ParameterValue`].
    fn from_json(object: &Map<String, Value>) -> Result<Self> {
        let object = &canonical(Self::OWNER, Self::TABLE, object)?;
        for (key, value) in object {
            let Some(parameter) = Self::TABLE.iter().find(|p| p.key == key) else {
                let keys: Vec<_> = Self::TABLE.iter().map(|p| p.key).collect();
                return Err(ModelError::UnknownParameter {
                    owner: Self::OWNER,
                    key: key.clone(),
                    allowed: match corsmal_names::closest(key, keys.iter().copied()) {
                        _ if keys.is_empty() => "it has none".into(),
                        Some(meant) => {
                            format!("did you mean {meant}? It has {}", keys.join(", "))
                        }
                        None => format!("it has {}", keys.join(", ")),
                    },
                });
            };
            // One key at a time, so that the refusal can name it.
            let single = Map::from_iter([(key.clone(), value.clone())]);
            if serde_json::from_value::<Self>(Value::Object(single)).is_err() {
                return Err(Self::refuse(parameter.key, value));
            }
        }
        let params: Self = serde_json::from_value(Value::Object(object.clone()))
            .map_err(|e| ModelError::Inconsistent(e.to_string()))?;
        params.check()?;
        Ok(params)
    }

    /// The refusal of `value` for `key`, with the allowed values of the table.
    fn refuse(key: &'static str, value: impl std::fmt::Display) -> ModelError {
        let allowed = Self::TABLE.iter().find(|p| p.key == key).map_or("", |p| p.allowed);
        ModelError::ParameterValue {
            owner: Self::OWNER,
            key: key.into(),
            value: value.to_string(),
            allowed: allowed.into(),
        }
    }

    /// `Ok` when `holds`, else the refusal of `value` for `key`.
    fn require(holds: bool, key: &'static str, value: impl std::fmt::Display) -> Result<()> {
        if holds { Ok(()) } else { Err(Self::refuse(key, value)) }
    }
}

/// scikit-learn's names of parameters that are called otherwise here.
pub const SKLEARN_NAMES: &[(&str, &str)] = &[
    ("n_neighbors", "k"),
    ("n_estimators", "trees"),
    ("random_state", "seed"),
    ("cache_size", "cache_mb"),
];

/// The key of `table` that a user's word stands for: itself, or scikit-learn's name of it.
pub(crate) fn key_of<'a>(table: &[Parameter], word: &'a str) -> &'a str {
    let known = |key: &str| table.iter().any(|p| p.key == key);
    let alias = SKLEARN_NAMES.iter().find(|(name, key)| *name == word && known(key));
    match alias {
        Some((_, key)) if !known(word) => key,
        _ => word,
    }
}

/// The same object with the keys of the table.
fn canonical(
    owner: &'static str,
    table: &[Parameter],
    object: &Map<String, Value>,
) -> Result<Map<String, Value>> {
    let mut renamed = Map::new();
    for (word, value) in object {
        let key = key_of(table, word);
        if renamed.insert(key.to_string(), value.clone()).is_some() {
            let remedy = format!("{word} is scikit-learn's name for it; keep one of them");
            return Err(ModelError::GivenTwice { owner, key: key.into(), remedy });
        }
    }
    Ok(renamed)
}

/// Declares a parameter struct with its table: `field: Type = default, "what it may be", "what it
/// does";`. The ranges are checked by the block after `check`, to which the struct is given by the
/// name in parentheses; it gives a [`Result`](crate::Result).
///
/// ```
/// use corsmal_models::params::{Parameters, parameters};
///
/// parameters! {
///     /// Parameters of a rule with one threshold.
///     ThresholdParams, "threshold" {
///         feature: usize = 0, "a feature number from 0", "the feature compared";
///     }
///     check(_this) {
///         Ok(())
///     }
/// }
/// assert_eq!(ThresholdParams::TABLE[0].key, "feature");
/// ```
#[macro_export]
macro_rules! parameters {
    (
        $(#[$meta:meta])*
        $name:ident, $owner:literal {
            $($(#[$field_meta:meta])* $field:ident: $type:ty = $default:expr, $allowed:literal, $help:literal;)*
        }
        check($this:ident) $check:block
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $(#[doc = $help] $(#[$field_meta])* pub $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::params::Parameters for $name {
            const OWNER: &'static str = $owner;
            const TABLE: &'static [$crate::params::Parameter] = &[
                $($crate::params::Parameter {
                    key: stringify!($field), allowed: $allowed, help: $help,
                },)*
            ];

            fn check(&self) -> $crate::error::Result<()> {
                let $this = self;
                $check
            }

            fn values(&self) -> $crate::params::Values {
                let mut values = $crate::params::Values::new();
                $(values.insert(
                    stringify!($field).to_string(),
                    $crate::params::json(&self.$field),
                );)*
                values
            }
        }
    };
}
pub use parameters;

/// Parameters by key.
pub type Values = Map<String, Value>;

/// A parameter's value as JSON; `null` where it has none.
#[doc(hidden)]
pub fn json<T: Serialize>(value: &T) -> Value {
    serde_json::to_value(value).unwrap_or(Value::Null)
}

/// Parses `key=value` texts into a JSON object: values that are JSON stay so, `a,b,c` becomes a
/// list, anything else is text.
///
/// # Errors
/// [`ModelError::NotKeyValue`], [`ModelError::KeyTwice`].
pub fn key_values<S: AsRef<str>>(texts: &[S]) -> Result<Map<String, Value>> {
    let mut object = Map::new();
    for text in texts.iter().map(AsRef::as_ref) {
        let (key, value) = text
            .split_once('=')
            .filter(|(key, _)| !key.trim().is_empty())
            .ok_or_else(|| ModelError::NotKeyValue { text: text.into() })?;
        let (key, value) = (key.trim(), scalar_or_list(value.trim()));
        if let Some(first) = object.get(key) {
            let (first, second) = (first.to_string(), value.to_string());
            return Err(ModelError::KeyTwice { key: key.into(), first, second });
        }
        object.insert(key.into(), value);
    }
    Ok(object)
}

fn scalar_or_list(text: &str) -> Value {
    let scalar = |t: &str| serde_json::from_str(t).unwrap_or_else(|_| Value::String(t.into()));
    match serde_json::from_str(text) {
        Ok(value) => value,
        Err(_) if text.contains(',') => text.split(',').map(|t| scalar(t.trim())).collect(),
        Err(_) => Value::String(text.into()),
    }
}

/// How rows of each class count.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ClassWeight {
    /// every row counts 1
    #[default]
    Equal,
    /// by rule
    Rule(WeightRule),
    /// a weight per class, in the order of the label table
    PerClass(Vec<f64>),
}

/// Weights computed from the class counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WeightRule {
    /// rows / (classes · rows of the class), as scikit-learn
    Balanced,
}

impl ClassWeight {
    /// Whether all weights given are finite and positive.
    pub(crate) fn is_valid(&self) -> bool {
        match self {
            Self::PerClass(weights) => {
                !weights.is_empty() && weights.iter().all(|w| w.is_finite() && *w > 0.0)
            }
            _ => true,
        }
    }

    /// The weight of every class; a rule takes the weights of the rows for their number.
    ///
    /// # Errors
    /// As [`ClassWeight::per_class`].
    pub(crate) fn per_class_of(
        &self,
        y: &[usize],
        n_classes: usize,
        row_weights: Option<&[f64]>,
    ) -> Result<Vec<f64>> {
        let (Self::Rule(WeightRule::Balanced), Some(row_weights)) = (self, row_weights) else {
            return self.per_class(y, n_classes);
        };
        let mut sums = vec![0.0; n_classes];
        y.iter().zip(row_weights).for_each(|(&class, weight)| sums[class] += weight);
        let present = sums.iter().filter(|&&sum| sum > 0.0).count() as f64;
        let total: f64 = sums.iter().sum();
        let weight = |&sum: &f64| if sum > 0.0 { total / (present * sum) } else { 1.0 };
        Ok(sums.iter().map(weight).collect())
    }

    /// The weight of every class.
    ///
    /// # Errors
    /// [`ModelError::Length`] when the list has not one weight per class.
    pub(crate) fn per_class(&self, y: &[usize], n_classes: usize) -> Result<Vec<f64>> {
        match self {
            Self::Equal => Ok(vec![1.0; n_classes]),
            Self::Rule(WeightRule::Balanced) => {
                let mut counts = vec![0usize; n_classes];
                y.iter().for_each(|&c| counts[c] += 1);
                let present = counts.iter().filter(|&&c| c > 0).count();
                let weight = |&c: &usize| y.len() as f64 / (present * c.max(1)) as f64;
                Ok(counts.iter().map(weight).collect())
            }
            Self::PerClass(weights) if weights.len() == n_classes => Ok(weights.clone()),
            Self::PerClass(weights) => Err(ModelError::Length {
                what: "class_weight",
                expected: n_classes,
                actual: weights.len(),
            }),
        }
    }
}
