//! Principal components through the smaller of the two Gram matrices.
//!
//! Signs follow scikit-learn (1.5 and later): the entry of largest magnitude of each component is
//! positive.

use linfa_linalg::eigh::{EigSort, EighInto};
use ndarray::{Array1, Array2, ArrayView2, Axis, s};
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
            "a whole number up to min(rows, features), a part of the variance below 1.0, or null",
            "components kept; null: min(rows, features)";
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
                allowed: format!("{rows} rows x {features} features give at most {most}"),
            });
        }
        let mean = x.sum_axis(Axis(0)) / rows as f64;
        let centred = &x - &mean;
        let wide = features > rows;
        let gram = if wide { centred.dot(&centred.t()) } else { centred.t().dot(&centred) };
        let failed = |e: linfa_linalg::LinalgError| ModelError::Numerical {
            owner: Self::OWNER,
            reason: e.to_string(),
        };
        if !gram.iter().all(|v| v.is_finite()) {
            return Err(ModelError::Numerical {
                owner: Self::OWNER,
                reason: "features too large for their variance".into(),
            });
        }
        let (values, vectors) = gram.eigh_into().map_err(failed)?.sort_eig_desc();
        let values = values.mapv(|v| v.max(0.0));
        let total = values.sum();
        if total <= 0.0 {
            return Err(ModelError::ConstantFeature { feature: 0, rows, count: features, features });
        }
        let kept = match self.n_components {
            None => most,
            Some(Components::Count(n)) => n,
            Some(Components::Variance(part)) => {
                let mut sum = 0.0;
                let enough = values.iter().position(|v| {
                    sum += v / total;
                    sum > part
                });
                enough.map_or(most, |at| (at + 1).min(most))
            }
        };
        let kept_vectors = vectors.slice(s![.., ..kept]);
        let mut components = if wide { kept_vectors.t().dot(&centred) } else { kept_vectors.t().to_owned() };
        for mut component in components.outer_iter_mut() {
            let length = component.dot(&component).sqrt();
            let largest = component.iter().fold(0.0f64, |a, &b| if b.abs() > a.abs() { b } else { a });
            // A direction without any variance (rank below the count asked) stays zero.
            let factor = if length > 0.0 { largest.signum() / length } else { 0.0 };
            component *= factor;
        }
        let kept_values = values.slice(s![..kept]);
        Ok(Pca {
            mean,
            components: components.as_standard_layout().into_owned(),
            explained_variance: &kept_values / (rows - 1) as f64,
            explained_variance_ratio: &kept_values / total,
        })
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
