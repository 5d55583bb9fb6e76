//! Batch normalisation.

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::layers::linear::column;
use crate::matrix::Matrix;
use crate::parameters::{Declared, Initial};
#[cfg(any(test, feature = "gpu"))]
use burn_tensor::{Tensor, module};
use rayon::prelude::*;

const EPSILON: f64 = 1e-5;
/// Share of a batch in a running statistic, as in PyTorch.
pub(crate) const MOMENTUM: f64 = 0.1;

/// Each channel to mean 0 and variance 1 over the batch (in evaluation: by the running statistics),
/// then scaled and shifted.
#[derive(Clone, Debug)]
pub struct BatchNorm {
    name: String,
    channels: usize,
}

impl BatchNorm {
    /// `name.weight`, `name.bias`, `name.running_mean`, `name.running_var`.
    pub fn new(name: impl Into<String>, channels: usize) -> Self {
        Self { name: name.into(), channels }
    }

    fn key(&self, what: &str) -> String {
        format!("{}.{what}", self.name)
    }

    /// `[items, channels, …]`
    #[cfg(any(test, feature = "gpu"))]
    fn normal<const D: usize>(&self, x: Tensor<D>, pass: &mut gpu::Pass<'_>) -> Tensor<D> {
        let [weight, bias, mean, variance] = ["weight", "bias", "running_mean", "running_var"]
            .map(|what| pass.parameter(&self.key(what), [self.channels]));
        if !pass.is_training() {
            return module::batch_norm(x, weight, bias, mean, variance, EPSILON);
        }
        let n = (x.dims().iter().product::<usize>() / self.channels) as f64;
        let found = module::batch_norm_train(x, weight, bias, EPSILON);
        pass.statistic(self.key("running_mean"), found.mean, 1.0);
        pass.statistic(self.key("running_var"), found.variance, n / (n - 1.0).max(1.0));
        found.output
    }
}

/// A running statistic after a batch whose own is `new`.
pub(crate) fn moved(old: &[f32], new: impl Fn(usize) -> f64) -> Vec<f32> {
    let one = |(c, &old): (usize, &f32)| (1.0 - MOMENTUM) * f64::from(old) + MOMENTUM * new(c);
    old.iter().enumerate().map(|each| one(each) as f32).collect()
}

impl Layer for BatchNorm {
    fn describe(&self) -> String {
        format!("{}: batch normalisation of {}", self.name, self.channels)
    }

    fn parameters(&self) -> Vec<Declared> {
        let n = self.channels;
        vec![
            Declared::trained(self.key("weight"), &[n], Initial::Constant(1.0)),
            Declared::trained(self.key("bias"), &[n], Initial::Constant(0.0)),
            Declared::running(self.key("running_mean"), n, 0.0),
            Declared::running(self.key("running_var"), n, 1.0),
        ]
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        let refusal =
            || NetError::layer(self.describe(), format!("{} channels", self.channels), input);
        (input.numbers() == self.channels).then_some(input).ok_or_else(refusal)
    }

    fn fewest_items(&self, input: Shape) -> usize {
        // One number of a channel has no variance.
        if input.len() == self.channels { 2 } else { 1 }
    }

    fn forward(&self, mut input: Batch, pass: &mut Pass<'_>) -> Batch {
        let parameters = pass.parameters;
        let numbers = |what| parameters.get(&self.key(what)).values();
        let (weight, bias) = (numbers("weight"), numbers("bias"));
        let (old_mean, old_var) = (numbers("running_mean"), numbers("running_var"));
        let Some(training) = &mut pass.training else {
            let both = weight.iter().zip(old_var);
            let scale: Vec<f32> = both
                .map(|(&w, &v)| (f64::from(w) / (f64::from(v) + EPSILON).sqrt()) as f32)
                .collect();
            let shift: Vec<f32> =
                (0..self.channels).map(|c| bias[c] - old_mean[c] * scale[c]).collect();
            affine(input.values.values_mut(), &scale, &shift);
            return input;
        };
        let n = input.values.rows() as f64;
        let mut mean = kernels::column_sums(input.values.values(), self.channels);
        mean.iter_mut().for_each(|m| *m /= n);
        let squares = kernels::column_squares(input.values.values(), &mean);
        let unbiased = |c: usize| squares[c] / (n - 1.0).max(1.0);
        training.running.push((self.key("running_mean"), moved(old_mean, |c| mean[c])));
        training.running.push((self.key("running_var"), moved(old_var, unbiased)));
        let inverse: Vec<f32> =
            squares.iter().map(|s| (1.0 / (s / n + EPSILON).sqrt()) as f32).collect();
        let shift: Vec<f32> =
            (0..self.channels).map(|c| (-mean[c] * f64::from(inverse[c])) as f32).collect();
        affine(input.values.values_mut(), &inverse, &shift);
        let inverse = Matrix::new(1, self.channels, inverse);
        pass.save(|| Saved::Matrices(vec![input.values.clone(), inverse]));
        affine(input.values.values_mut(), weight, bias);
        input
    }

    fn backward(&self, mut gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Matrices(saved) = pass.saved() else { unreachable!("saves two matrices") };
        let [normal, inverse] = &saved[..] else { unreachable!("saves two matrices") };
        let channels = self.channels;
        let n = normal.rows() as f64;
        let g = gradient.values.values_mut();
        let sums = kernels::column_sums(g, channels);
        let products = kernels::column_products(g, normal.values(), channels);
        let weight = pass.parameters.get(&self.key("weight")).values();
        // dx = w / sigma * (g - mean(g) - x * mean(g x))
        let scale: Vec<f32> = weight.iter().zip(inverse.values()).map(|(w, i)| w * i).collect();
        let mean: Vec<f32> = sums.iter().map(|s| (s / n) as f32).collect();
        let slope: Vec<f32> = products.iter().map(|p| (p / n) as f32).collect();
        let piece = kernels::rows_per_piece(channels) * channels;
        g.par_chunks_mut(piece).zip(normal.values().par_chunks(piece)).for_each(|(g, x)| {
            kernels::vectorized(
                #[inline(always)]
                || {
                    for (g, x) in g.chunks_exact_mut(channels).zip(x.chunks_exact(channels)) {
                        let settings = scale.iter().zip(&mean).zip(&slope);
                        for ((g, x), ((s, m), k)) in g.iter_mut().zip(x).zip(settings) {
                            *g = s * (*g - m - x * k);
                        }
                    }
                },
            );
        });
        pass.add(self.key("weight"), column(products));
        pass.add(self.key("bias"), column(sums));
        gradient
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        match input {
            gpu::Flow::Vector(x) => gpu::Flow::Vector(self.normal(x, pass)),
            gpu::Flow::Image(x) => gpu::Flow::Image(self.normal(x, pass)),
            gpu::Flow::Sequence(x, lengths) => {
                let dims = x.dims();
                let flat = self.normal(x.flatten::<2>(0, 1), pass);
                gpu::Flow::Sequence(flat.reshape(dims), lengths)
            }
        }
    }
}

/// `scale * x + shift`, column by column.
fn affine(values: &mut [f32], scale: &[f32], shift: &[f32]) {
    let n = scale.len();
    values.par_chunks_mut(kernels::rows_per_piece(n) * n).for_each(|piece| {
        kernels::vectorized(
            #[inline(always)]
            || {
                for row in piece.chunks_exact_mut(n) {
                    for ((v, s), t) in row.iter_mut().zip(scale).zip(shift) {
                        *v = *v * s + t;
                    }
                }
            },
        );
    });
}
