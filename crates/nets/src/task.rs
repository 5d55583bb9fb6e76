//! What a training learns from.

use crate::items::Items;

/// Rows and classes of a training.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// all items
    pub items: &'a Items,
    /// class of each item
    pub classes: &'a [usize],
    /// items trained on
    pub train: &'a [usize],
    /// items whose score is watched after each epoch: a validation group, or the test fold as
    /// published; empty: none
    pub watched: &'a [usize],
}
