//! Fully connected layer.

use super::uniform_by;
use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::matrix::Matrix;
use crate::parameters::Declared;

/// `y = x W^T + b` at every place.
#[derive(Clone, Debug)]
pub struct Linear {
    name: String,
    inputs: usize,
    outputs: usize,
}

impl Linear {
    /// `name.weight` `[outputs, inputs]` and `name.bias`.
    pub fn new(name: impl Into<String>, inputs: usize, outputs: usize) -> Self {
        Self { name: name.into(), inputs, outputs }
    }
}

impl Layer for Linear {
    fn describe(&self) -> String {
        format!("{}: linear {} to {}", self.name, self.inputs, self.outputs)
    }

    fn parameters(&self) -> Vec<Declared> {
        let initial = uniform_by(self.inputs);
        let (weight, bias) = (format!("{}.weight", self.name), format!("{}.bias", self.name));
        vec![
            Declared::trained(weight, &[self.outputs, self.inputs], initial),
            Declared::trained(bias, &[self.outputs], initial),
        ]
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        let fits = input.numbers() == self.inputs && !matches!(input, Shape::Image { .. });
        let refusal =
            || NetError::layer(self.describe(), format!("{} numbers", self.inputs), input);
        fits.then(|| input.with_numbers(self.outputs)).ok_or_else(refusal)
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let [weight, bias] = ["weight", "bias"].map(|what| format!("{}.{what}", self.name));
        let values = pass.product(&input.values, &weight, &bias);
        let shape = input.shape.with_numbers(self.outputs);
        let lengths = input.lengths.clone();
        pass.save(|| Saved::Batch(input));
        Batch { values, shape, lengths }
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Batch(input) = pass.saved() else { unreachable!("linear saves its input") };
        let weight = format!("{}.weight", self.name);
        pass.add(weight.clone(), gradient.values.t_dot(&input.values));
        let sums = kernels::column_sums(gradient.values.values(), self.outputs);
        pass.add(format!("{}.bias", self.name), column(sums));
        if !pass.wanted {
            return gradient;
        }
        let values = gradient.values.dot(pass.parameters.get(&weight));
        Batch { values, shape: input.shape, lengths: input.lengths }
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        let (weight, bias) = (format!("{}.weight", self.name), format!("{}.bias", self.name));
        let weight = pass.parameter(&weight, [self.outputs, self.inputs]).transpose();
        let bias = pass.parameter(&bias, [1, self.outputs]);
        match input {
            gpu::Flow::Vector(x) => gpu::Flow::Vector(x.matmul(weight) + bias),
            gpu::Flow::Sequence(x, lengths) => {
                let [items, steps, _] = x.dims();
                let out = x.reshape([items * steps, self.inputs]).matmul(weight) + bias;
                gpu::Flow::Sequence(out.reshape([items, steps, self.outputs]), lengths)
            }
            gpu::Flow::Image(_) => unreachable!("shapes were checked"),
        }
    }
}

/// Sums as the gradient of a vector.
pub(crate) fn column(sums: Vec<f64>) -> Matrix {
    Matrix::new(sums.len(), 1, sums.into_iter().map(|s| s as f32).collect())
}
