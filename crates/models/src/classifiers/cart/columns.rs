//! The training table as trees read it.

use ndarray::{Array2, ArrayView2, Axis};

use crate::error::{ModelError, Result};

/// Training rows by column, in single precision.
pub(in crate::classifiers) struct FeatureColumns {
    /// `[features, rows]`
    values: Array2<f32>,
}

impl FeatureColumns {
    /// # Errors
    /// [`ModelError::NonFinite`] for values beyond the range of single precision.
    pub(in crate::classifiers) fn new(x: ArrayView2<'_, f64>) -> Result<Self> {
        let mut values = Array2::<f32>::zeros((x.ncols(), x.nrows()));
        // Row blocks keep both sides of the transposition in the cache.
        for (mut columns, rows) in
            values.axis_chunks_iter_mut(Axis(1), 32).zip(x.axis_chunks_iter(Axis(0), 32))
        {
            columns.zip_mut_with(&rows.t(), |to, &from| *to = from as f32);
        }
        if let Some(((feature, row), _)) = values.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(ModelError::NonFinite { row, feature, value: x[[row, feature]] });
        }
        Ok(Self { values })
    }

    /// Number of features.
    pub(super) fn count(&self) -> usize {
        self.values.nrows()
    }

    /// The values of all rows.
    pub(super) fn column(&self, feature: usize) -> &[f32] {
        let rows = self.values.ncols();
        let all = self.values.as_slice().expect("a new array is contiguous");
        &all[feature * rows..(feature + 1) * rows]
    }
}
