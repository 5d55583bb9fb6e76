//! A choice of features.

use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};
use crate::params::{Parameters, parameters};

parameters! {
    /// Parameters of the choice of features.
    ColumnsParams, "columns" {
        keep: Vec<usize> = Vec::new(), "a list of feature numbers from 0", "features to keep, in \
            this order";
    }
    check(this) {
        Self::require(!this.keep.is_empty(), "keep", "[]")
    }
}

/// Features that go on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Columns {
    n_inputs: usize,
    keep: Vec<usize>,
}

impl ColumnsParams {
    pub(super) fn fit(&self, x: ArrayView2<'_, f64>) -> Result<Columns> {
        self.check()?;
        if let Some(&outside) = self.keep.iter().find(|&&f| f >= x.ncols()) {
            return Err(ModelError::ParameterValue {
                owner: Self::OWNER,
                key: "keep".into(),
                value: outside.to_string(),
                allowed: format!("numbers of features, 0 to {}", x.ncols().saturating_sub(1)),
            });
        }
        Ok(Columns { n_inputs: x.ncols(), keep: self.keep.clone() })
    }
}

impl Columns {
    pub(super) fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    pub(super) fn n_outputs(&self) -> usize {
        self.keep.len()
    }

    pub(super) fn transform(&self, x: ArrayView2<'_, f64>) -> Array2<f64> {
        x.select(Axis(1), &self.keep)
    }

    pub(super) fn is_sound(&self) -> bool {
        !self.keep.is_empty() && self.keep.iter().all(|&f| f < self.n_inputs)
    }
}
