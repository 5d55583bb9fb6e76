//! Layers that only rearrange numbers.

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::matrix::Matrix;

/// Images become vectors in PyTorch's order: channel, row, column.
#[derive(Clone, Copy, Debug)]
pub struct Flatten;

impl Layer for Flatten {
    fn describe(&self) -> String {
        "flatten".into()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        match input {
            Shape::Image { .. } => Ok(Shape::Vector(input.len())),
            _ => Err(NetError::layer(self.describe(), "an image", input)),
        }
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let (items, shape) = (input.items(), input.shape);
        let values = Matrix::new(items, shape.len(), input.channels_first());
        pass.save(|| Saved::Shape(shape, None));
        Batch { values, shape: Shape::Vector(shape.len()), lengths: None }
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Shape(shape, _) = pass.saved() else { unreachable!("flatten saves its shape") };
        Batch::from_channels_first(gradient.values.values(), shape)
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Image(x) = input else { unreachable!("shapes were checked") };
        gpu::Flow::Vector(x.flatten(1, 3))
    }
}

/// Images become vectors pixel by pixel: row, column, channel.
#[derive(Clone, Copy, Debug)]
pub struct FlattenPixels;

impl Layer for FlattenPixels {
    fn describe(&self) -> String {
        "flatten pixel by pixel".into()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        Flatten.output(input)
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let (items, shape) = (input.items(), input.shape);
        pass.save(|| Saved::Shape(shape, None));
        let values = input.values.reshaped(items, shape.len());
        Batch { values, shape: Shape::Vector(shape.len()), lengths: None }
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Shape(shape, _) = pass.saved() else { unreachable!("flatten saves its shape") };
        let rows = gradient.values.rows() * shape.places();
        Batch { values: gradient.values.reshaped(rows, shape.numbers()), shape, lengths: None }
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Image(x) = input else { unreachable!("shapes were checked") };
        gpu::Flow::Vector(x.permute([0, 2, 3, 1]).flatten(1, 3))
    }
}

/// Appends the numbers of another input of the network.
#[derive(Clone, Copy, Debug)]
pub struct Join {
    /// which of the inputs beyond the first
    pub other: usize,
    /// its numbers
    pub numbers: usize,
}

impl Layer for Join {
    fn describe(&self) -> String {
        format!("append the {} numbers of input {}", self.numbers, self.other + 2)
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        match input {
            Shape::Vector(n) => Ok(Shape::Vector(n + self.numbers)),
            _ => Err(NetError::layer(self.describe(), "a vector", input)),
        }
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let (n, extra) = (input.shape.numbers(), self.numbers);
        let mut values = Vec::with_capacity(input.items() * (n + extra));
        let added = pass.others[self.other].values.values().chunks_exact(extra);
        for (row, added) in input.values.values().chunks_exact(n).zip(added) {
            values.extend_from_slice(row);
            values.extend_from_slice(added);
        }
        Batch::new(values, Shape::Vector(n + extra))
    }

    fn backward(&self, gradient: Batch, _: &mut Backward<'_>) -> Batch {
        let n = gradient.shape.numbers();
        let rows = gradient.values.values().chunks_exact(n);
        let kept = rows.flat_map(|row| &row[..n - self.numbers]).copied().collect();
        Batch::new(kept, Shape::Vector(n - self.numbers))
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Vector(x) = input else { unreachable!("shapes were checked") };
        let gpu::Flow::Vector(added) = pass.others[self.other].clone() else {
            unreachable!("appends vectors")
        };
        gpu::Flow::Vector(burn_tensor::Tensor::cat(vec![x, added], 1))
    }
}
