//! What a network takes.

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
use crate::network::Network;

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

impl Network {
    /// Arrays in PyTorch's layouts as this network's inputs: `[items, channels, height, width]`,
    /// `[items, steps, numbers]`, `[items, numbers]`. Several inputs of one kind may come as one
    /// array whose second axis counts them.
    ///
    /// # Errors
    /// [`NetError::InputShape`], [`NetError::InputCount`].
    pub fn batches(&self, arrays: &[(Vec<usize>, Vec<f32>)]) -> Result<Vec<Batch>> {
        let inputs = self.inputs();
        let refusal = |input: &str, expected: String, actual: &[usize]| NetError::InputShape {
            network: self.name().to_owned(),
            input: input.into(),
            expected,
            actual: format!("{actual:?}"),
        };
        if let ([(shape, values)], true) = (arrays, inputs.len() > 1) {
            let [items, count, steps, numbers] = shape[..] else {
                let expected = format!("[items, {}, steps, numbers]", inputs.len());
                return Err(refusal("array", expected, shape));
            };
            if count != inputs.len()
                || values.len() != shape.iter().product::<usize>()
                || steps == 0
            {
                let expected = format!("[items, {}, steps, numbers]", inputs.len());
                return Err(refusal("array", expected, shape));
            }
            let each = steps * numbers;
            let view = |v: usize| {
                let items = (0..items).map(|i| &values[(i * count + v) * each..][..each]);
                (vec![shape[0], steps, numbers], items.flatten().copied().collect())
            };
            return self.batches(&(0..count).map(view).collect::<Vec<_>>());
        }
        if arrays.len() != inputs.len() {
            let (network, expected, actual) = (self.name().to_owned(), inputs.len(), arrays.len());
            return Err(NetError::InputCount { network, expected, actual });
        }
        let one = |(input, (shape, values)): (&Input, &(Vec<usize>, Vec<f32>))| {
            let fits = input.takes(shape.get(1..).unwrap_or_default());
            if !fits || values.len() != shape.iter().product::<usize>() || values.is_empty() {
                return Err(refusal(&input.name, input.layout(), shape));
            }
            Ok(match input.shape {
                Shape::Image { .. } => Batch::from_channels_first(values, input.shape),
                Shape::Sequence { numbers, .. } => {
                    Batch::new(values.clone(), Shape::Sequence { steps: shape[1], numbers })
                }
                Shape::Vector(_) => Batch::new(values.clone(), input.shape),
            })
        };
        inputs.iter().zip(arrays).map(one).collect()
    }
}
