//! What a way forward through recurrent layers keeps.

use super::cell::States;
use super::packing::Packing;
use crate::batch::Shape;
use crate::matrix::Matrix;

/// What recurrent layers keep for the way back.
#[derive(Debug)]
pub struct Trace {
    pub(super) packing: Packing,
    pub(super) layers: Vec<LayerTrace>,
    pub(super) shape: Shape,
    pub(super) lengths: Option<Vec<usize>>,
}

#[derive(Debug)]
pub(super) struct LayerTrace {
    pub(super) input: Matrix,
    pub(super) states: States,
    /// dropout of the input, when it is on
    pub(super) kept: Vec<u8>,
}
