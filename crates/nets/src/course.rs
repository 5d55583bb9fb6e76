//! What a training learns.

use crate::items::Items;
use crate::loss::{Loss, Targets};

/// What is learned: checked items with their targets, and which of them.
pub(crate) struct Course<'a> {
    /// all items
    pub items: &'a Items,
    /// what each item's outputs shall be
    pub targets: &'a Targets,
    /// items trained on
    pub train: &'a [usize],
    /// items rated after each epoch; empty: none
    pub watched: &'a [usize],
    /// the loss
    pub loss: Loss,
    /// weight of each class; empty: equal
    pub class_weights: Vec<f32>,
}
