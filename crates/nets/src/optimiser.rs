//! Optimisers, with PyTorch's conventions.

use std::collections::HashMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::kernels;
use crate::matrix::Matrix;
use crate::parameters::Parameters;

/// Kind and settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "optimizer", rename_all = "kebab-case", deny_unknown_fields)]
pub enum OptimiserSpec {
    /// stochastic gradient descent
    Sgd {
        /// learning rate
        lr: f64,
        /// momentum, 0 for none
        #[serde(default)]
        momentum: f64,
        /// coupled weight decay
        #[serde(default)]
        weight_decay: f64,
    },
    /// Adam: betas .9 and .999, epsilon 1e-8
    Adam {
        /// learning rate
        lr: f64,
        /// coupled weight decay (added to the gradient)
        #[serde(default)]
        weight_decay: f64,
    },
}

const BETA1: f64 = 0.9;
const BETA2: f64 = 0.999;
const EPSILON: f32 = 1e-8;
/// Numbers of a piece of work for a thread.
const PIECE: usize = 1 << 15;

/// An optimiser at work.
#[derive(Clone, Debug)]
pub struct Optimiser {
    spec: OptimiserSpec,
    /// share of the learning rate that the next step takes
    pub share: f64,
    /// steps done
    pub steps: u64,
    /// moments of each trained parameter, in the order of the parameters
    pub moments: Vec<[Vec<f32>; 2]>,
}

impl Optimiser {
    /// Before the first step.
    pub fn new(spec: OptimiserSpec, parameters: &Parameters) -> Self {
        let trained = parameters.declared().iter().filter(|d| d.trained);
        let moments = trained
            .map(|d| {
                let second = if matches!(spec, OptimiserSpec::Adam { .. }) { d.len() } else { 0 };
                [vec![0.0; d.len()], vec![0.0; second]]
            })
            .collect();
        Self { spec, share: 1.0, steps: 0, moments }
    }

    /// Changes the parameters by their gradients.
    pub fn step(&mut self, parameters: &mut Parameters, gradients: &HashMap<String, Matrix>) {
        self.steps += 1;
        let names: Vec<String> =
            parameters.declared().iter().filter(|d| d.trained).map(|d| d.name.clone()).collect();
        for (name, moments) in names.iter().zip(&mut self.moments) {
            let Some(gradient) = gradients.get(name) else { continue };
            let values = parameters.get_mut(name).values_mut();
            match self.spec {
                OptimiserSpec::Sgd { lr, momentum, weight_decay } => {
                    let first = self.steps == 1;
                    let settings = ((self.share * lr) as f32, momentum as f32, weight_decay as f32);
                    sgd(values, gradient.values(), &mut moments[0], settings, first);
                }
                OptimiserSpec::Adam { lr, weight_decay } => {
                    let lr = self.share * lr;
                    adam(values, gradient.values(), moments, lr, weight_decay as f32, self.steps);
                }
            }
        }
    }
}

fn sgd(
    values: &mut [f32],
    gradient: &[f32],
    velocity: &mut [f32],
    (lr, momentum, decay): (f32, f32, f32),
    first: bool,
) {
    let all = values.par_chunks_mut(PIECE).zip(gradient.par_chunks(PIECE));
    all.zip(velocity.par_chunks_mut(PIECE)).for_each(|((values, gradient), velocity)| {
        for ((w, &g), v) in values.iter_mut().zip(gradient).zip(velocity) {
            let g = g + decay * *w;
            *v = if first { g } else { momentum * *v + g };
            *w -= lr * *v;
        }
    });
}

fn adam(
    values: &mut [f32],
    gradient: &[f32],
    [first, second]: &mut [Vec<f32>; 2],
    lr: f64,
    decay: f32,
    step: u64,
) {
    let step = i32::try_from(step).unwrap_or(i32::MAX);
    let size = (lr / (1.0 - BETA1.powi(step))) as f32;
    let root = ((1.0 - BETA2.powi(step)).sqrt()) as f32;
    let (b1, b2) = (BETA1 as f32, BETA2 as f32);
    let (c1, c2) = ((1.0 - BETA1) as f32, (1.0 - BETA2) as f32);
    let moments = first.par_chunks_mut(PIECE).zip(second.par_chunks_mut(PIECE));
    let all = values.par_chunks_mut(PIECE).zip(gradient.par_chunks(PIECE)).zip(moments);
    all.for_each(|((values, gradient), (first, second))| {
        kernels::vectorized(
            #[inline(always)]
            || {
                let moments = first.iter_mut().zip(second);
                for ((w, &g), (m, v)) in values.iter_mut().zip(gradient).zip(moments) {
                    let g = g + decay * *w;
                    *m = b1 * *m + c1 * g;
                    *v = b2 * *v + c2 * g * g;
                    *w -= size * *m / (v.sqrt() / root + EPSILON);
                }
            },
        );
    });
}

/// Scales all gradients, of this common norm, so that it is at most `largest`.
pub fn clip(gradients: &mut HashMap<String, Matrix>, norm: f64, largest: f64) {
    let factor = largest / (norm + 1e-6);
    if factor < 1.0 {
        gradients.values_mut().for_each(|g| kernels::scale(g.values_mut(), factor as f32));
    }
}
