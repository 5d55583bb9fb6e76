//! What a network takes.

use crate::batch::Shape;

/// One of a network's inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// its name
    pub name: String,
    /// shape of an item; sequences have 0 steps here, as many as there are in a batch
    pub shape: Shape,
}

impl Input {
    /// A named input.
    pub fn new(name: impl Into<String>, shape: Shape) -> Self {
        Self { name: name.into(), shape }
    }

    /// Whether an item of this shape in PyTorch's layout is one.
    pub fn takes(&self, item: &[usize]) -> bool {
        match (self.shape, item) {
            (Shape::Vector(n), &[m]) => n == m,
            (Shape::Image { height, width, channels }, &[c, h, w]) => {
                (c, h, w) == (channels, height, width)
            }
            (Shape::Sequence { numbers, .. }, &[steps, m]) => numbers == m && steps > 0,
            _ => false,
        }
    }

    /// Items in PyTorch's layout, for people.
    pub fn layout(&self) -> String {
        match self.shape {
            Shape::Vector(n) => format!("[items, {n}]"),
            Shape::Image { height, width, channels } => {
                format!("[items, {channels}, {height}, {width}]")
            }
            Shape::Sequence { numbers, .. } => format!("[items, steps, {numbers}]"),
        }
    }
}
