//! Principal components ([`corsmal_dsp::pca`]) as a step before a classifier.

use corsmal_dsp::DspError;
use ndarray::{Array1, Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};
use crate::params::{Parameters, parameters};

/// How many components are kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Components {
    /// this many
    Count(usize),
    /// as many as explain more than this part of the variance
    Variance(f64),
}

parameters! {
    /// Parameters of principal component analysis.
    PcaParams, "pca" {
        n_components: Option<Components> = None,
            "a whole number up to min(rows, features), a share of the variance below 1.0, or null",
            "components to keep; null: min(rows, features)";
    }
    check(this) {
        match this.n_components {
            Some(Components::Count(n)) => Self::require(n >= 1, "n_components", n),
            Some(Components::Variance(v)) => Self::require(v > 0.0 && v < 1.0, "n_components", v),
            None => Ok(()),
        }
    }
}

/// Fitted components.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pca {
    mean: Array1<f64>,
    /// `[components, features]`, orthonormal rows
    components: Array2<f64>,
    /// variance along each (divisor rows − 1)
    explained_variance: Array1<f64>,
    /// the same as parts of the total variance
    explained_variance_ratio: Array1<f64>,
}

impl PcaParams {
    pub(super) fn fit(&self, x: ArrayView2<'_, f64>) -> Result<Pca> {
        self.check()?;
        let (rows, features) = x.dim();
        let most = rows.min(features);
        if rows < 2 {
            return Err(ModelError::Length { what: "rows for pca", expected: 2, actual: rows });
        }
        if let Some(Components::Count(n)) = self.n_components
            && n > most
        {
            return Err(ModelError::ParameterValue {
                owner: Self::OWNER,
                key: "n_components".into(),
                value: n.to_string(),
                allowed: format!("at most {most} for {rows} rows x {features} features"),
            });
        }
        let failed = |e: DspError| ModelError::Numerical {
            owner: Self::OWNER,
            reason: format!("{e}: standardise the features"),
        };
        let part = match self.n_components {
            Some(Components::Variance(part)) => part,
            _ => 1.0,
        };
        let (fitted, total) = match self.n_components {
            Some(Components::Count(n)) => {
                let fitted = corsmal_dsp::pca::Pca::fit(x, n).map_err(failed)?;
                let total = fitted.total_variance(x);
                (fitted, total)
            }
            _ => corsmal_dsp::pca::Pca::fit_explaining(x, part).map_err(failed)?,
        };
        if total <= 0.0 {
            return Err(ModelError::ConstantFeature {
                feature: 0,
                rows,
                count: features,
                features,
            });
        }
        let corsmal_dsp::pca::Pca { mean, components, explained_variance } = fitted;
        let explained_variance_ratio = &explained_variance / total;
        Ok(Pca { mean, components, explained_variance, explained_variance_ratio })
    }
}

impl Pca {
    pub(super) fn n_inputs(&self) -> usize {
        self.mean.len()
    }

    /// Components kept.
    pub fn n_components(&self) -> usize {
        self.components.nrows()
    }

    /// `[components, features]`, orthonormal rows.
    pub fn components(&self) -> ArrayView2<'_, f64> {
        self.components.view()
    }

    /// Variance along each component (divisor rows − 1), and the same as parts of the total.
    pub fn explained_variance(&self) -> (&Array1<f64>, &Array1<f64>) {
        (&self.explained_variance, &self.explained_variance_ratio)
    }

    pub(super) fn transform(&self, x: ArrayView2<'_, f64>) -> Array2<f64> {
        (&x - &self.mean).dot(&self.components.t())
    }

    pub(super) fn is_sound(&self) -> bool {
        let (kept, features) = self.components.dim();
        let all = self.components.iter().chain(&self.mean);
        self.mean.len() == features
            && self.explained_variance.len() == kept
            && self.explained_variance_ratio.len() == kept
            && all.chain(&self.explained_variance).all(|v| v.is_finite())
    }
}
