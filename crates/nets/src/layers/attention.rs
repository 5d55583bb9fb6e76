//! Attention over the steps of a sequence.

use rayon::prelude::*;

use super::uniform_by;
use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::matrix::Matrix;
use crate::parameters::Declared;

/// The mean of the steps, weighted by the softmax over the steps of a linear score. Padding has no weight.
#[derive(Clone, Debug)]
pub struct Attention {
    name: String,
    inputs: usize,
}

impl Attention {
    /// `name.weight` `[1, inputs]` gives the score of a step.
    pub fn new(name: impl Into<String>, inputs: usize) -> Self {
        Self { name: name.into(), inputs }
    }

    fn weight(&self) -> String {
        format!("{}.weight", self.name)
    }
}

impl Layer for Attention {
    fn describe(&self) -> String {
        let Self { name, inputs } = self;
        format!("{name}: mean of the steps of {inputs}, weighted by attention")
    }

    fn parameters(&self) -> Vec<Declared> {
        vec![Declared::trained(self.weight(), &[1, self.inputs], uniform_by(self.inputs))]
    }

    fn kept(&self, input: Shape) -> usize {
        // The steps, which it changes into the gradient by them, and two numbers for each.
        input.len() + 2 * input.places() + 2 * self.inputs
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        match input {
            Shape::Sequence { numbers, .. } if numbers == self.inputs => Ok(Shape::Vector(numbers)),
            _ => {
                let expected = format!("steps of {} numbers", self.inputs);
                Err(NetError::layer(self.describe(), expected, input))
            }
        }
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let (n, steps, items) = (self.inputs, input.shape.places(), input.items());
        let score = pass.parameters.get(&self.weight()).values();
        let mut weights = Matrix::zeros(items, steps);
        let mut out = Matrix::zeros(items, n);
        let each =
            out.values_mut().par_chunks_mut(n).zip(weights.values_mut().par_chunks_mut(steps));
        each.zip(input.values.values().par_chunks(steps * n)).enumerate().for_each(
            |(item, ((out, weights), values))| {
                let length = input.lengths.as_ref().map_or(steps, |l| l[item].clamp(1, steps));
                let weights = &mut weights[..length];
                for (weight, step) in weights.iter_mut().zip(values.chunks_exact(n)) {
                    *weight = dot(step, score);
                }
                softmax(weights);
                for (&weight, step) in weights.iter().zip(values.chunks_exact(n)) {
                    out.iter_mut().zip(step).for_each(|(out, &x)| *out += weight * x);
                }
            },
        );
        pass.save(|| Saved::Matrices(vec![weights]));
        pass.save(|| Saved::Batch(input));
        Batch { values: out, shape: Shape::Vector(n), lengths: None }
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Batch(mut input) = pass.saved() else { unreachable!("saves its input") };
        let Saved::Matrices(saved) = pass.saved() else { unreachable!("saves its weights") };
        let [weights] = &saved[..] else { unreachable!("saves one matrix") };
        let (n, steps) = (self.inputs, input.shape.places());
        let score = pass.parameters.get(&self.weight()).values();
        // By the scores: for each step its weight times what it gives above the mean.
        let mut by_scores = Matrix::zeros(input.values.rows(), 1);
        let gradients = gradient.values.values();
        let each = by_scores.values_mut().par_chunks_mut(steps).enumerate();
        let values = input.values.values().par_chunks(steps * n);
        each.zip(values).for_each(|((item, by_scores), values)| {
            let gradient = &gradients[item * n..][..n];
            let weights = &weights.values()[item * steps..][..steps];
            for (by, step) in by_scores.iter_mut().zip(values.chunks_exact(n)) {
                *by = dot(gradient, step);
            }
            let mean = dot(weights, by_scores);
            by_scores.iter_mut().zip(weights).for_each(|(by, weight)| *by = weight * (*by - mean));
        });
        pass.add(self.weight(), by_scores.t_dot(&input.values));
        if !pass.wanted {
            return gradient;
        }
        let by_input = input.values.values_mut().par_chunks_mut(steps * n).enumerate();
        by_input.for_each(|(item, by_input)| {
            let gradient = &gradients[item * n..][..n];
            let place = item * steps;
            for (step, by) in by_input.chunks_exact_mut(n).enumerate() {
                let (weight, by_score) =
                    (weights.values()[place + step], by_scores.values()[place + step]);
                for ((by, &g), &s) in by.iter_mut().zip(gradient).zip(score) {
                    *by = weight * g + by_score * s;
                }
            }
        });
        input
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Sequence(x, lengths) = input else { unreachable!("shapes were checked") };
        let [items, steps, n] = x.dims();
        let score = pass.parameter(&self.weight(), [1, 1, n]);
        let scores: burn_tensor::Tensor<2> = (x.clone() * score).sum_dim(2).squeeze_dim(2);
        let scores = match lengths {
            None => scores,
            Some(lengths) => {
                // So low that its softmax is zero.
                let padding =
                    |length: usize| (0..steps).map(move |s| if s < length { 0.0 } else { -1e30 });
                let padding = lengths.iter().flat_map(|&l| padding(l.clamp(1, steps))).collect();
                scores + pass.tensor(padding, [items, steps])
            }
        };
        let weights = burn_tensor::activation::softmax(scores, 1).unsqueeze_dim::<3>(2);
        gpu::Flow::Vector((x * weights).sum_dim(1).squeeze_dim(1))
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Scores to weights that add up to one.
fn softmax(scores: &mut [f32]) {
    let largest = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    scores.iter_mut().for_each(|s| *s = kernels::exp(*s - largest));
    let sum: f32 = scores.iter().sum();
    scores.iter_mut().for_each(|s| *s /= sum);
}
