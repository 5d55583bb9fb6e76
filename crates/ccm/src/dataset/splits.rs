//! The splits that published methods used.

use corsmal_models::splits::{Fold, train_test_split};

use super::container::{Container, Subset};
use super::filling::Filling;
use super::name::SequenceName;
use crate::error::{CcmError, Result};

/// The published random splits of the 684 training recordings into 80 % and 20 %, all made with
/// scikit-learn's `train_test_split(test_size=.2, random_state=42)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PublishedSplit {
    /// The 12 audio baselines: stratified by the joint class as a number.
    Baselines,
    /// M6, first list: stratified by one-hot labels as text, whose order is the reverse.
    M6Stratified,
    /// M6, second list: not stratified.
    M6Plain,
}

/// The 684 training recordings in the row order of the 2020 scripts, which random splits refer to.
pub fn training_order() -> impl Iterator<Item = (Container, SequenceName)> {
    Subset::Training.containers().flat_map(|c| SequenceName::all(c).map(move |n| (c, n)))
}

impl PublishedSplit {
    /// Row numbers in [`training_order`] of both parts.
    ///
    /// # Errors
    /// None in practice; the split of fixed data cannot fail.
    pub fn rows(self) -> Result<Fold> {
        let joint: Vec<usize> = training_order().map(|(_, n)| n.filling.joint()).collect();
        let classes: Option<Vec<usize>> = match self {
            Self::Baselines => Some(joint),
            Self::M6Stratified => Some(joint.iter().map(|j| Filling::COUNT - 1 - j).collect()),
            Self::M6Plain => None,
        };
        let rows = training_order().count();
        train_test_split(rows, 0.2, 42, classes.as_deref())
            .map_err(|e| CcmError::Request(format!("published split: {e}")))
    }
}
