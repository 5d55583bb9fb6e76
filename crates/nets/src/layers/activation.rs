//! Activations.

use rayon::prelude::*;

use crate::batch::{Batch, Shape};
use crate::error::Result;
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Layer, Pass, Saved};

/// Negative numbers become zero.
#[derive(Clone, Copy, Debug)]
pub struct Relu;

impl Layer for Relu {
    fn describe(&self) -> String {
        "ReLU".into()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        Ok(input)
    }

    fn forward(&self, mut input: Batch, pass: &mut Pass<'_>) -> Batch {
        kernels::relu(input.values.values_mut());
        pass.save(|| Saved::Batch(input.clone()));
        input
    }

    fn backward(&self, mut gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Batch(output) = pass.saved() else { unreachable!("ReLU saves its output") };
        kernels::relu_backward(gradient.values.values_mut(), output.values.values());
        gradient
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        input.map(burn_tensor::activation::relu)
    }
}

/// Logistic function.
#[derive(Clone, Copy, Debug)]
pub struct Sigmoid;

impl Layer for Sigmoid {
    fn describe(&self) -> String {
        "sigmoid".into()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        Ok(input)
    }

    fn forward(&self, mut input: Batch, pass: &mut Pass<'_>) -> Batch {
        input.values.values_mut().iter_mut().for_each(|v| *v = 1.0 / (1.0 + (-*v).exp()));
        pass.save(|| Saved::Batch(input.clone()));
        input
    }

    fn backward(&self, mut gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Batch(output) = pass.saved() else { unreachable!("sigmoid saves its output") };
        let both = gradient.values.values_mut().iter_mut().zip(output.values.values());
        both.for_each(|(g, y)| *g *= y * (1.0 - y));
        gradient
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        input.map(burn_tensor::activation::sigmoid)
    }
}

/// Softmax over the numbers of a place.
#[derive(Clone, Copy, Debug)]
pub struct Softmax;

impl Layer for Softmax {
    fn describe(&self) -> String {
        "softmax".into()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        Ok(input)
    }

    fn forward(&self, mut input: Batch, pass: &mut Pass<'_>) -> Batch {
        softmax(input.values.values_mut(), input.shape.numbers());
        pass.save(|| Saved::Batch(input.clone()));
        input
    }

    fn backward(&self, mut gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Batch(output) = pass.saved() else { unreachable!("softmax saves its output") };
        let n = output.shape.numbers();
        let rows = gradient.values.values_mut().chunks_exact_mut(n);
        for (g, y) in rows.zip(output.values.values().chunks_exact(n)) {
            let dot: f32 = g.iter().zip(y).map(|(g, y)| g * y).sum();
            g.iter_mut().zip(y).for_each(|(g, y)| *g = y * (*g - dot));
        }
        gradient
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        use burn_tensor::activation::softmax;
        match input {
            gpu::Flow::Vector(x) => gpu::Flow::Vector(softmax(x, 1)),
            gpu::Flow::Image(x) => gpu::Flow::Image(softmax(x, 1)),
            gpu::Flow::Sequence(x, lengths) => gpu::Flow::Sequence(softmax(x, 2), lengths),
        }
    }
}

/// Softmax of every row of `n` numbers.
pub fn softmax(values: &mut [f32], n: usize) {
    values.par_chunks_exact_mut(n.max(1)).for_each(|row| {
        let largest = row.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        row.iter_mut().for_each(|v| *v = (*v - largest).exp());
        let sum: f32 = row.iter().sum();
        row.iter_mut().for_each(|v| *v /= sum);
    });
}
