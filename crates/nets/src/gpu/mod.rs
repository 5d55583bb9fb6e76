//! Networks on a GPU: the layers in burn's tensors, and gradients by its automatic differentiation.
//!
//! Parameters, loss, optimiser, random numbers and checkpoints are those of the CPU, so a training differs from
//! the CPU's only by rounding. A step sends the parameters and brings back the gradients by them. Where a device or
//! its driver fails, burn panics.

mod flow;
mod pass;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use burn_tensor::{Device, Tensor, TensorData, Transaction};
use corsmal_files::shield::shielded;

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
use crate::layer::Layer;
use crate::matrix::Matrix;
use crate::network::Gradients;
use crate::parameters::Parameters;
use crate::random::Stream;

pub use flow::Flow;
pub use pass::Pass;

/// The numbers of a network on a GPU, each parameter flat.
pub(crate) type Uploaded = HashMap<String, Tensor<1>>;

/// A GPU at work.
#[derive(Clone, Debug)]
pub struct Gpu {
    device: Device,
    name: String,
}

/// Layers of each input, whose outputs are summed.
pub(crate) type Chains<'a> = [&'a [Box<dyn Layer>]];

impl Gpu {
    /// The GPU that wgpu takes by itself, opened once for the process.
    ///
    /// # Errors
    /// [`NetError::NoDevice`] when there is none.
    #[cfg(feature = "gpu")]
    pub(crate) fn open() -> Result<Self> {
        use std::sync::OnceLock;
        static OPENED: OnceLock<std::result::Result<Gpu, String>> = OnceLock::new();
        let opened = OPENED.get_or_init(|| {
            let device = shielded(|| Device::wgpu_options().init())?.map_err(|e| e.to_string())?;
            let name =
                shielded(|| device.identity())?.map_or("GPU".into(), |identity| identity.name);
            Ok(Self { device, name: name.to_string() })
        });
        let refusal = |reason: &String| NetError::NoDevice {
            name: "gpu".into(),
            reason: format!("{reason}; --device cpu needs no GPU"),
        };
        opened.as_ref().map(Clone::clone).map_err(refusal)
    }

    /// burn's CPU backend in its place.
    #[cfg(test)]
    pub(crate) fn stand_in() -> Self {
        Self { device: Device::flex(), name: "stand-in".into() }
    }

    /// What it calls itself.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn failure(&self, reason: String) -> NetError {
        NetError::Gpu { name: self.name.clone(), reason }
    }

    /// Outputs in evaluation mode.
    ///
    /// # Errors
    /// [`NetError::Gpu`].
    pub(crate) fn outputs(
        &self,
        parameters: &Parameters,
        inputs: &[Batch],
        chains: &Chains<'_>,
    ) -> Result<Batch> {
        let values = shielded(|| {
            let tensors = parameters.uploaded(|| self.upload(parameters));
            let mut pass = Pass::new(&self.device, &tensors, inputs, None);
            let out = pass.network(inputs, chains);
            (out.dims(), numbers(out.try_into_data()))
        });
        match values {
            Ok((dims, Ok(values))) => Ok(rows(dims, values)),
            Ok((_, Err(reason))) | Err(reason) => Err(self.failure(reason)),
        }
    }

    /// Loss and gradients in training mode; `loss` gives its value and the gradient by the outputs.
    ///
    /// # Errors
    /// [`NetError::Gpu`], and those of the loss.
    pub(crate) fn gradients(
        &self,
        parameters: &Parameters,
        inputs: &[Batch],
        chains: &Chains<'_>,
        dropout: Option<Stream>,
        loss: impl FnOnce(&Batch) -> Result<(f64, Batch)>,
    ) -> Result<Gradients> {
        let forward = shielded(|| {
            let trained = |name: &String, tensor: Tensor<1>| match parameters.is_trained(name) {
                true => tensor.autodiff().require_grad(),
                false => tensor,
            };
            let uploaded = self.upload(parameters).into_iter();
            let tensors: Uploaded =
                uploaded.map(|(name, t)| (name.clone(), trained(&name, t))).collect();
            let mut pass = Pass::new(&self.device, &tensors, inputs, Some(dropout));
            let out = pass.network(inputs, chains);
            let statistics = pass.into_statistics();
            let values = numbers(out.clone().inner().try_into_data());
            (tensors, out, statistics, values)
        });
        let (tensors, out, statistics, values) = forward.map_err(|reason| self.failure(reason))?;
        let outputs = rows(out.dims(), values.map_err(|reason| self.failure(reason))?);
        let (loss, gradient) = loss(&outputs)?;
        let backward = shielded(|| {
            let data = TensorData::new(gradient.values.into_values(), out.dims());
            // The gradient of this sum by the outputs is the one wanted.
            let mut found = (out * Tensor::from_data(data, &self.device)).sum().backward();
            let (mut names, mut reading) = (Vec::new(), Transaction::default());
            for declared in parameters.declared().iter().filter(|d| d.trained) {
                if let Some(gradient) = tensors[&declared.name].grad_remove(&mut found) {
                    names.push(declared);
                    reading = reading.register(gradient);
                }
            }
            for statistic in &statistics {
                reading = reading.register(statistic.new.clone());
            }
            let mut read =
                reading.try_execute().map_err(|e| e.to_string())?.into_iter().map(vector);
            let mut by_parameter = HashMap::new();
            for (declared, values) in names.into_iter().zip(read.by_ref()) {
                let first = declared.shape[0];
                let matrix = Matrix::new(first, declared.len() / first, values?);
                by_parameter.insert(declared.name.clone(), matrix);
            }
            let running = statistics.into_iter().zip(read);
            let running = running.map(|(s, values)| Ok(s.moved(parameters, &values?)));
            Ok((by_parameter, running.collect::<std::result::Result<_, String>>()?))
        });
        let (by_parameter, running) = backward.and_then(|b| b).map_err(|r| self.failure(r))?;
        Ok(Gradients { loss, by_parameter, running, outputs })
    }

    fn upload(&self, parameters: &Parameters) -> Uploaded {
        let one = |(declared, values): (&crate::parameters::Declared, &[f32])| {
            let data = TensorData::new(values.to_vec(), [values.len()]);
            (declared.name.clone(), Tensor::from_data(data, &self.device))
        };
        parameters.iter().map(one).collect()
    }
}

/// Vectors, an item after another.
fn rows([_, n]: [usize; 2], values: Vec<f32>) -> Batch {
    Batch::new(values, Shape::Vector(n))
}

fn numbers<E: ToString>(
    data: std::result::Result<TensorData, E>,
) -> std::result::Result<Vec<f32>, String> {
    data.map_err(|e| e.to_string()).and_then(vector)
}

fn vector(data: TensorData) -> std::result::Result<Vec<f32>, String> {
    data.try_into_vec().map_err(|e| format!("{e:?}"))
}
