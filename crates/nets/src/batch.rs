//! What flows through a network: a batch of vectors, images or sequences.

use std::fmt;

use crate::matrix::Matrix;

/// Shape of one item of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// numbers
    Vector(usize),
    /// pixels; channels lie side by side
    Image {
        /// rows of pixels
        height: usize,
        /// columns of pixels
        width: usize,
        /// numbers per pixel
        channels: usize,
    },
    /// steps of time, as many as the longest item has; shorter items are followed by padding
    Sequence {
        /// steps of the longest item
        steps: usize,
        /// numbers per step
        numbers: usize,
    },
}

impl Shape {
    /// Places of one item: 1, pixels, or steps.
    pub fn places(self) -> usize {
        match self {
            Self::Vector(_) => 1,
            Self::Image { height, width, .. } => height * width,
            Self::Sequence { steps, .. } => steps,
        }
    }

    /// Numbers at each place.
    pub fn numbers(self) -> usize {
        match self {
            Self::Vector(n) => n,
            Self::Image { channels, .. } => channels,
            Self::Sequence { numbers, .. } => numbers,
        }
    }

    /// All numbers of one item.
    pub fn len(self) -> usize {
        self.places() * self.numbers()
    }

    /// Whether an item has no numbers.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The same places with another number of numbers.
    pub fn with_numbers(self, n: usize) -> Self {
        match self {
            Self::Vector(_) => Self::Vector(n),
            Self::Image { height, width, .. } => Self::Image { height, width, channels: n },
            Self::Sequence { steps, .. } => Self::Sequence { steps, numbers: n },
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Vector(n) => write!(f, "{n}"),
            Self::Image { height, width, channels } => write!(f, "{channels} x {height} x {width}"),
            Self::Sequence { steps: 0, numbers } => write!(f, "steps x {numbers}"),
            Self::Sequence { steps, numbers } => write!(f, "{steps} x {numbers}"),
        }
    }
}

/// Items of one shape. The matrix has a row for each place of each item.
#[derive(Clone, Debug)]
pub struct Batch {
    /// `[items * places, numbers]`
    pub values: Matrix,
    /// shape of an item
    pub shape: Shape,
    /// steps of each item, for sequences
    pub lengths: Option<Vec<usize>>,
}

impl Batch {
    /// From numbers, item after item, channels last.
    ///
    /// # Panics
    /// When the numbers are not whole items.
    pub fn new(values: Vec<f32>, shape: Shape) -> Self {
        let numbers = shape.numbers();
        let rows = values.len() / numbers.max(1);
        Self { values: Matrix::new(rows, numbers, values), shape, lengths: None }
    }

    /// From images in PyTorch's order, `[items, channels, height, width]`.
    ///
    /// # Panics
    /// When the numbers are not whole items.
    pub fn from_channels_first(values: &[f32], shape: Shape) -> Self {
        let (places, channels) = (shape.places(), shape.numbers());
        let mut out = vec![0.0; values.len()];
        for (from, to) in values.chunks(shape.len()).zip(out.chunks_mut(shape.len())) {
            transpose(from, to, channels, places);
        }
        Self::new(out, shape)
    }

    /// Items.
    pub fn items(&self) -> usize {
        self.values.rows() / self.shape.places().max(1)
    }

    /// The numbers item after item, images in PyTorch's order.
    pub fn channels_first(&self) -> Vec<f32> {
        let (places, channels) = (self.shape.places(), self.shape.numbers());
        let values = self.values.values();
        if !matches!(self.shape, Shape::Image { .. }) || places == 1 || channels == 1 {
            return values.to_vec();
        }
        let mut out = vec![0.0; values.len()];
        for (from, to) in values.chunks(self.shape.len()).zip(out.chunks_mut(self.shape.len())) {
            transpose(from, to, places, channels);
        }
        out
    }
}

/// `[rows, cols]` to `[cols, rows]`.
pub(crate) fn transpose(from: &[f32], to: &mut [f32], rows: usize, cols: usize) {
    for (r, row) in from.chunks_exact(cols.max(1)).enumerate() {
        for (c, &v) in row.iter().enumerate() {
            to[c * rows + r] = v;
        }
    }
}
