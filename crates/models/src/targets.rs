//! Class indices as targets of a linfa data set.

use linfa::dataset::AsTargets;
use ndarray::{Array1, ArrayView1, Ix1};

use crate::error::Result;
use crate::table::check_labels;

/// The class of each row, and how many classes there are: some may have no rows, as in a fold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Classes {
    indices: Array1<usize>,
    n_classes: usize,
}

impl Classes {
    /// Class indices below `n_classes`.
    ///
    /// # Errors
    /// [`ModelError::ClassOutOfRange`](crate::ModelError::ClassOutOfRange).
    pub fn new(indices: Vec<usize>, n_classes: usize) -> Result<Self> {
        check_labels(indices.len(), &indices, n_classes)?;
        Ok(Self { indices: indices.into(), n_classes })
    }

    /// The class of each row.
    pub fn indices(&self) -> ArrayView1<'_, usize> {
        self.indices.view()
    }

    /// Number of classes, those without rows included.
    pub fn n_classes(&self) -> usize {
        self.n_classes
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The classes of some rows, in their order.
    pub(crate) fn select(&self, rows: &[usize]) -> Self {
        let indices = rows.iter().map(|&row| self.indices[row]).collect();
        Self { indices, n_classes: self.n_classes }
    }
}

impl AsTargets for Classes {
    type Elem = usize;
    type Ix = Ix1;

    fn as_targets(&self) -> ArrayView1<'_, usize> {
        self.indices.view()
    }
}
