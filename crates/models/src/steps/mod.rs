//! Steps before the classifier, fitted on training rows only.

mod columns;
mod pca;
mod prepared;
mod standardize;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use self::columns::{Columns, ColumnsParams};
pub use self::pca::{Components, Pca, PcaParams};
pub use self::prepared::{Prepared, through};
pub use self::standardize::{ConstantRule, Standardize, StandardizeParams};
use crate::error::{ModelError, Result};
use crate::params::Parameters;
use crate::table::{check_features, check_query};

/// A step's name with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "name", content = "parameters")]
pub enum StepSpec {
    /// zero mean and unit variance for each feature
    #[serde(rename = "standardize")]
    Standardize(StandardizeParams),
    /// principal components
    #[serde(rename = "pca")]
    Pca(PcaParams),
    /// a choice of features
    #[serde(rename = "columns")]
    Columns(ColumnsParams),
}

/// Names and descriptions of all steps.
pub const STEPS: &[(&str, &str)] = &[
    ("standardize", "zero mean and unit variance"),
    ("pca", "principal components"),
    ("columns", "a choice of features"),
];

impl StepSpec {
    /// The step of this name, its parameters from a JSON object.
    ///
    /// # Errors
    /// Unknown name, unknown parameter, impossible value.
    pub fn new(name: &str, parameters: &Map<String, Value>) -> Result<Self> {
        match name {
            "standardize" => StandardizeParams::from_json(parameters).map(Self::Standardize),
            "pca" => PcaParams::from_json(parameters).map(Self::Pca),
            "columns" => ColumnsParams::from_json(parameters).map(Self::Columns),
            _ => Err(ModelError::UnknownName {
                kind: "step",
                name: name.into(),
                allowed: STEPS.iter().map(|s| s.0).collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Standardize(_) => StandardizeParams::OWNER,
            Self::Pca(_) => PcaParams::OWNER,
            Self::Columns(_) => ColumnsParams::OWNER,
        }
    }

    /// Learns from training rows `[rows, features]`.
    ///
    /// # Errors
    /// Impossible parameters, features that are not finite, or too few rows or features.
    pub fn fit(&self, x: ArrayView2<'_, f64>) -> Result<Step> {
        check_features(x)?;
        match self {
            Self::Standardize(params) => params.fit(x).map(Step::Standardize),
            Self::Pca(params) => params.fit(x).map(Step::Pca),
            Self::Columns(params) => params.fit(x).map(Step::Columns),
        }
    }
}

/// A fitted step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Step {
    /// zero mean and unit variance
    Standardize(Standardize),
    /// principal components
    Pca(Pca),
    /// a choice of features
    Columns(Columns),
}

impl Step {
    /// Features it takes.
    pub fn n_inputs(&self) -> usize {
        match self {
            Self::Standardize(step) => step.n_features(),
            Self::Pca(step) => step.n_inputs(),
            Self::Columns(step) => step.n_inputs(),
        }
    }

    /// Features it gives.
    pub fn n_outputs(&self) -> usize {
        match self {
            Self::Standardize(step) => step.n_features(),
            Self::Pca(step) => step.n_components(),
            Self::Columns(step) => step.n_outputs(),
        }
    }

    /// `[rows, inputs]` to `[rows, outputs]`.
    ///
    /// # Errors
    /// Another number of features than in training, or features that are not finite.
    pub fn transform(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        check_query(x, self.n_inputs())?;
        Ok(match self {
            Self::Standardize(step) => step.transform(x),
            Self::Pca(step) => step.transform(x),
            Self::Columns(step) => step.transform(x),
        })
    }

    pub(crate) fn validate(&self) -> Result<()> {
        let sound = match self {
            Self::Standardize(step) => step.is_sound(),
            Self::Pca(step) => step.is_sound(),
            Self::Columns(step) => step.is_sound(),
        };
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("step".into())) }
    }
}
