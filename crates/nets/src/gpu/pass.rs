//! A way through a network on a GPU.

use burn_tensor::{Device, Tensor, TensorData};

use super::{Chains, Flow, Uploaded};
use crate::batch::Batch;
use crate::layer::Layer;
use crate::layers::dropout::{self, Draws};
use crate::layers::moved;
use crate::parameters::Parameters;
use crate::random::Stream;

/// What layers find on their way.
#[derive(Debug)]
pub struct Pass<'a> {
    device: &'a Device,
    tensors: &'a Uploaded,
    /// inputs beyond the first
    pub(crate) others: Vec<Flow>,
    training: Option<Training>,
}

#[derive(Debug)]
struct Training {
    dropout: Draws,
    statistics: Vec<Statistic>,
}

/// A statistic of the batch, for a running one.
#[derive(Debug)]
pub(super) struct Statistic {
    name: String,
    pub(super) new: Tensor<1>,
    factor: f64,
}

impl Statistic {
    /// The running statistic after this batch.
    pub(super) fn moved(self, parameters: &Parameters, new: &[f32]) -> (String, Vec<f32>) {
        let old = parameters.get(&self.name).values();
        let values = moved(old, |c| self.factor * f64::from(new[c]));
        (self.name, values)
    }
}

impl<'a> Pass<'a> {
    /// `training`: whether it is one, and random numbers where dropout is on.
    pub(super) fn new(
        device: &'a Device,
        tensors: &'a Uploaded,
        inputs: &[Batch],
        training: Option<Option<Stream>>,
    ) -> Self {
        let others = inputs.iter().skip(1).map(|batch| Flow::of(batch, device)).collect();
        let training =
            training.map(|step| Training { dropout: Draws::new(step), statistics: Vec::new() });
        Self { device, tensors, others, training }
    }

    /// Through all chains; their sum.
    pub(super) fn network(&mut self, inputs: &[Batch], chains: &Chains<'_>) -> Tensor<2> {
        let each = chains.iter().zip(inputs).map(|(layers, input)| {
            match self.chain(layers, Flow::of(input, self.device)) {
                Flow::Vector(out) => out,
                _ => unreachable!("networks end in vectors"),
            }
        });
        match each.reduce(|sum, more| sum + more) {
            Some(sum) => sum,
            None => unreachable!("networks have inputs"),
        }
    }

    pub(super) fn into_statistics(self) -> Vec<Statistic> {
        self.training.map_or_else(Vec::new, |training| training.statistics)
    }

    /// Through all layers of a chain.
    pub(crate) fn chain(&mut self, layers: &[Box<dyn Layer>], input: Flow) -> Flow {
        layers.iter().fold(input, |x, layer| layer.on_gpu(x, self))
    }

    /// Whether this is training.
    pub(crate) fn is_training(&self) -> bool {
        self.training.is_some()
    }

    /// A parameter in PyTorch's shape.
    pub(crate) fn parameter<const D: usize>(&self, name: &str, shape: [usize; D]) -> Tensor<D> {
        self.tensors[name].clone().reshape(shape)
    }

    /// Numbers of our own.
    pub(crate) fn tensor<const D: usize>(&self, values: Vec<f32>, shape: [usize; D]) -> Tensor<D> {
        Tensor::from_data(TensorData::new(values, shape), self.device)
    }

    /// Random numbers of the next dropout layer, when dropout is on.
    pub(crate) fn next_dropout(&mut self) -> Option<Stream> {
        self.training.as_mut()?.dropout.next_layer()
    }

    /// Drops numbers as the CPU does.
    pub(crate) fn drop(&mut self, input: Flow, probability: f32) -> Flow {
        let Some(stream) = self.next_dropout() else { return input };
        let (items, shape) = input.shape();
        let factors = dropout::factors(stream, probability, items * shape.len());
        let factors = Flow::new(factors, shape, None, self.device);
        input.zip(factors, |x, factors| x * factors)
    }

    /// Notes a statistic of the batch; the running one of this name moves towards `factor` times it.
    pub(crate) fn statistic(&mut self, name: String, new: Tensor<1>, factor: f64) {
        if let Some(training) = &mut self.training {
            training.statistics.push(Statistic { name, new: new.inner(), factor });
        }
    }
}
