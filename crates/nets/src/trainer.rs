//! Training steps.

use std::collections::HashMap;

use crate::batch::Batch;
use crate::error::{NetError, Result};
use crate::kernels;
use crate::loss::{Loss, Targets};
use crate::network::{Gradients, Network};
use crate::optimiser::{Optimiser, OptimiserSpec, clip};
use crate::parameters::not_finite;
use crate::random::Stream;

/// What a step needs beyond the network.
#[derive(Clone, Debug)]
pub struct StepSettings {
    /// optimiser
    pub optimiser: OptimiserSpec,
    /// largest common norm of the gradients
    pub clip_grad_norm: Option<f64>,
    /// the loss
    pub loss: Loss,
    /// weight of each class; empty: equal
    pub class_weights: Vec<f32>,
    /// random numbers of dropout; none: off
    pub dropout: Option<u64>,
}

/// A network in training.
#[derive(Debug)]
pub struct Trainer<'a> {
    /// the network
    pub network: &'a mut Network,
    /// the optimiser with its moments
    pub optimiser: Optimiser,
    settings: StepSettings,
}

/// What a step found.
#[derive(Debug)]
pub struct Step {
    /// the loss before the step
    pub loss: f64,
    /// norm of the gradient by each parameter, before clipping
    pub norms: HashMap<String, f64>,
    /// outputs before the step, in training mode
    pub outputs: Batch,
}

impl<'a> Trainer<'a> {
    /// Before the first step.
    pub fn new(network: &'a mut Network, settings: StepSettings) -> Self {
        let optimiser = Optimiser::new(settings.optimiser.clone(), network.parameters());
        Self { network, optimiser, settings }
    }

    /// One step: forward, backward, change.
    ///
    /// # Errors
    /// Inputs or targets that do not fit, and [`NetError::Diverged`] by a loss, a gradient or a
    /// running statistic: the network is as it was then. [`NetError::Diverged`] by a parameter that
    /// the step drove out of single precision: the network is of no use any more.
    pub fn step(&mut self, inputs: &[Batch], targets: &Targets) -> Result<Step> {
        let number = self.optimiser.steps + 1;
        let dropout = self.settings.dropout.map(|s| Stream::new(s, "dropout").part(number));
        let StepSettings { loss, class_weights, clip_grad_norm, .. } = &self.settings;
        let mut found = self.network.gradients(inputs, targets, loss, class_weights, dropout)?;
        let norms = finite_norms(self.network, &found, number)?;
        for (name, values) in &found.running {
            if let Some(value) = not_finite(values) {
                return Err(NetError::Diverged { step: number, what: name.clone(), value });
            }
        }
        if let Some(largest) = clip_grad_norm {
            // In the parameters' order: a sum over a hash map would change from run to run.
            let declared = self.network.parameters().declared();
            let all = declared.iter().filter_map(|d| norms.get(&d.name));
            let norm = all.map(|n| n * n).sum::<f64>().sqrt();
            clip(&mut found.by_parameter, norm, *largest);
        }
        self.optimiser.step(self.network.parameters_mut(), &found.by_parameter);
        for (name, values) in found.running {
            self.network.parameters_mut().get_mut(&name).values_mut().copy_from_slice(&values);
        }
        if let Some((name, value)) = self.network.parameters().not_finite() {
            return Err(NetError::Diverged { step: number, what: name.into(), value });
        }
        Ok(Step { loss: found.loss, norms, outputs: found.outputs })
    }
}

/// Norms of the gradients; refuses a loss or a gradient that is not finite.
fn finite_norms(network: &Network, found: &Gradients, step: u64) -> Result<HashMap<String, f64>> {
    let diverged = |what, value| Err(NetError::Diverged { step, what, value });
    if !found.loss.is_finite() {
        return diverged("the loss".into(), found.loss as f32);
    }
    let mut norms = HashMap::new();
    for d in network.parameters().declared() {
        let Some(gradient) = found.by_parameter.get(&d.name) else { continue };
        let norm = kernels::squares(gradient.values()).sqrt();
        if !norm.is_finite() {
            return diverged(format!("the gradient of {}", d.name), norm as f32);
        }
        norms.insert(d.name.clone(), norm);
    }
    Ok(norms)
}
