//! Zero mean and unit variance for each feature.

use ndarray::{Array1, Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};
use crate::params::parameters;

/// What happens to features that do not vary in the training rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ConstantRule {
    /// centred, not scaled
    Keep,
    /// an error
    Refuse,
}

parameters! {
    /// Parameters of standardisation.
    StandardizeParams, "standardize" {
        constant: ConstantRule = ConstantRule::Keep, "keep or refuse",
            "what to do with features without variation; if no feature varies, it is an error in \
             any case";
    }
    check(_this) {
        Ok(())
    }
}

/// Training mean and standard deviation (divisor n) of each feature.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Standardize {
    mean: Array1<f64>,
    /// 1 for features without variation
    scale: Array1<f64>,
}

impl StandardizeParams {
    pub(super) fn fit(&self, x: ArrayView2<'_, f64>) -> Result<Standardize> {
        let rows = x.nrows() as f64;
        let mean = x.sum_axis(Axis(0)) / rows;
        let mut variance = Array1::<f64>::zeros(x.ncols());
        for row in x.outer_iter() {
            variance.zip_mut_with(&(&row - &mean), |v, d| *v += d * d / rows);
        }
        // Below what rounding alone produces a feature counts as constant (scikit-learn's rule).
        let noise = |v: f64, m: f64| rows * f64::EPSILON * v + (rows * m * f64::EPSILON).powi(2);
        let constant: Vec<usize> =
            (0..x.ncols()).filter(|&i| variance[i] <= noise(variance[i], mean[i])).collect();
        if let Some(&feature) = constant.first()
            && (self.constant == ConstantRule::Refuse || constant.len() == x.ncols())
        {
            return Err(ModelError::ConstantFeature {
                feature,
                rows: x.nrows(),
                count: constant.len(),
                features: x.ncols(),
            });
        }
        let mut scale = variance.mapv(f64::sqrt);
        constant.iter().for_each(|&i| scale[i] = 1.0);
        match mean.iter().chain(&scale).all(|v| v.is_finite()) {
            true => Ok(Standardize { mean, scale }),
            false => Err(ModelError::Numerical {
                owner: "standardize",
                reason: "features too large for their variance".into(),
            }),
        }
    }
}

impl Standardize {
    pub(super) fn n_features(&self) -> usize {
        self.mean.len()
    }

    pub(super) fn transform(&self, x: ArrayView2<'_, f64>) -> Array2<f64> {
        (&x - &self.mean) / &self.scale
    }

    pub(super) fn is_sound(&self) -> bool {
        self.mean.len() == self.scale.len()
            && self.mean.iter().all(|v| v.is_finite())
            && self.scale.iter().all(|v| v.is_finite() && *v > 0.0)
    }
}
