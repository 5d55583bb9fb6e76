//! A network: inputs, layers, numbers.

use std::collections::HashMap;

use crate::batch::{Batch, Shape};
use crate::device::Device;
use crate::error::{NetError, Result};
use crate::layer::{Backward, Chain, Layer, Pass, Training, fewest_for, kept_by, passing_by};
use crate::loss::{Loss, Targets};
use crate::matrix::Matrix;
use crate::parameters::{Declared, Initial, Parameters};
use crate::random::Stream;
use crate::weights::State;

pub use crate::input::Input;

/// The layers between inputs and outputs.
#[derive(Debug)]
pub enum Body {
    /// one chain from the first input; [`crate::layers::Join`] takes in the others
    Chain(Chain),
    /// a chain for each input; their outputs are summed
    Sum(Vec<Chain>),
}

impl Body {
    fn chains(&self) -> &[Chain] {
        match self {
            Self::Chain(chain) => std::slice::from_ref(chain),
            Self::Sum(chains) => chains,
        }
    }

    /// All layers.
    pub fn layers(&self) -> impl Iterator<Item = &dyn Layer> {
        self.chains().iter().flatten().map(Box::as_ref)
    }
}

/// An architecture before it has numbers.
#[derive(Debug)]
pub struct Architecture {
    /// what it takes
    pub inputs: Vec<Input>,
    /// its layers
    pub body: Body,
    /// layers of the first chain whose output is the network's features
    pub features: Option<usize>,
    /// whether the last layer is an activation of the outputs, and no part of the loss
    pub activation: bool,
}

/// A network with its numbers.
#[derive(Debug)]
pub struct Network {
    name: String,
    architecture: Architecture,
    outputs: usize,
    parameters: Parameters,
    device: Device,
    through_activation: bool,
    /// what trainings begin with; `None`: random numbers
    beginning: Option<State>,
}

/// Loss and gradients of a batch.
#[derive(Debug)]
pub struct Gradients {
    /// the loss
    pub loss: f64,
    /// gradient by each trained parameter
    pub by_parameter: HashMap<String, Matrix>,
    /// new running statistics
    pub running: Vec<(String, Vec<f32>)>,
    /// the network's outputs
    pub outputs: Batch,
}

impl Network {
    /// With initial numbers of this seed. Checks that the layers fit one another.
    ///
    /// # Errors
    /// [`NetError::LayerInput`].
    pub fn new(name: impl Into<String>, architecture: Architecture, seed: u64) -> Result<Self> {
        let mut outputs = None;
        for (chain, input) in architecture.body.chains().iter().zip(&architecture.inputs) {
            let shape = chain.iter().try_fold(input.shape, |s, layer| layer.output(s))?;
            let fits =
                matches!(shape, Shape::Vector(_)) && outputs.is_none_or(|o| o == shape.len());
            if !fits {
                let expected = match outputs {
                    None => "a vector".to_string(),
                    Some(n) => format!("{n} numbers, as of the other inputs"),
                };
                return Err(NetError::layer("the network's end", expected, shape));
            }
            outputs = Some(shape.len());
        }
        let declared = architecture.body.layers().flat_map(|layer| layer.parameters()).collect();
        let parameters = Parameters::new(declared, seed);
        let (name, outputs) = (name.into(), outputs.unwrap_or(0));
        Ok(Self {
            name,
            architecture,
            outputs,
            parameters,
            device: Device::Cpu,
            through_activation: true,
            beginning: None,
        })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it takes.
    pub fn inputs(&self) -> &[Input] {
        &self.architecture.inputs
    }

    /// Numbers it gives for an item.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Its numbers.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Its numbers, to be trained.
    pub fn parameters_mut(&mut self) -> &mut Parameters {
        &mut self.parameters
    }

    /// Replaces all numbers; see [`Parameters::load`].
    ///
    /// # Errors
    /// [`NetError::Weights`].
    pub fn load_state(&mut self, state: &[(String, Vec<usize>, Vec<f32>)]) -> Result<()> {
        self.parameters.load(&self.name, state)
    }

    /// Layers with the shape after each, chain by chain, for people.
    pub fn describe(&self) -> Vec<(String, String)> {
        let mut lines = Vec::new();
        for (chain, input) in self.architecture.body.chains().iter().zip(self.inputs()) {
            lines.push((format!("input {}", input.name), input.shape.to_string()));
            let mut shape = input.shape;
            for layer in chain {
                if let Ok(next) = layer.output(shape) {
                    shape = next;
                }
                lines.push((layer.describe(), shape.to_string()));
            }
        }
        lines
    }

    /// Items that a training step needs at least: two where a batch is normalised number by number.
    pub(crate) fn fewest_items(&self) -> usize {
        let chains = self.architecture.body.chains().iter().zip(self.inputs());
        chains.map(|(chain, input)| fewest_for(chain, input.shape)).max().unwrap_or(1)
    }

    /// Numbers that a training step holds for an item of these input shapes, roughly.
    pub(crate) fn kept(&self, shapes: &[Shape]) -> usize {
        let chains = self.architecture.body.chains().iter().zip(shapes);
        chains.map(|(chain, &input)| kept_by(chain, input)).sum()
    }

    /// Numbers that evaluation holds for an item of these input shapes, roughly, beside the inputs.
    pub(crate) fn passing(&self, shapes: &[Shape]) -> usize {
        let chains = self.architecture.body.chains().iter().zip(shapes);
        chains.map(|(chain, &input)| passing_by(chain, input)).max().unwrap_or(0)
    }

    /// Refuses inputs of other shapes.
    ///
    /// # Errors
    /// [`NetError::InputShape`], [`NetError::InputCount`], [`NetError::Lengths`].
    pub fn check(&self, inputs: &[Batch]) -> Result<()> {
        let expected = self.inputs();
        if inputs.len() != expected.len() {
            let (expected, actual) = (expected.len(), inputs.len());
            return Err(NetError::InputCount { network: self.name.clone(), expected, actual });
        }
        let items = inputs.first().map_or(0, Batch::items);
        for (given, input) in inputs.iter().zip(expected) {
            let same = match (given.shape, input.shape) {
                (Shape::Sequence { steps, numbers }, Shape::Sequence { numbers: wanted, .. }) => {
                    numbers == wanted && steps > 0
                }
                (given, wanted) => given == wanted,
            };
            if !same || given.items() != items || items == 0 {
                return Err(NetError::InputShape {
                    network: self.name.clone(),
                    input: input.name.clone(),
                    expected: format!("{} x {}", items.max(1), input.shape),
                    actual: format!("{} x {}", given.items(), given.shape),
                });
            }
            self.check_lengths(given)?;
        }
        Ok(())
    }

    fn check_lengths(&self, given: &Batch) -> Result<()> {
        let (Some(lengths), steps) = (&given.lengths, given.shape.places()) else { return Ok(()) };
        let wrong = lengths.iter().position(|&n| n == 0 || n > steps);
        let actual = match wrong {
            Some(item) => format!("{} for item {item}", lengths[item]),
            None if lengths.len() != given.items() => format!("a list of {}", lengths.len()),
            None => return Ok(()),
        };
        Err(NetError::Lengths { network: self.name.clone(), steps, items: given.items(), actual })
    }

    /// Lets it compute on this device.
    pub fn run_on(&mut self, device: Device) {
        self.device = device;
    }

    /// Where it computes.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Outputs `[items, outputs]` in evaluation mode.
    ///
    /// # Errors
    /// Inputs of other shapes; a device that fails.
    pub fn forward(&self, inputs: &[Batch]) -> Result<Batch> {
        self.evaluate(inputs, &self.chains(true))
    }

    /// The same without the activation of the outputs.
    ///
    /// # Errors
    /// As [`Network::forward`].
    pub fn logits(&self, inputs: &[Batch]) -> Result<Batch> {
        self.evaluate(inputs, &self.chains(false))
    }

    /// Whether the loss sees the outputs after their activation, as some published code has it.
    pub fn train_through_activation(&mut self, through: bool) {
        self.through_activation = through;
    }

    /// The numbers that the network's last layers work on.
    ///
    /// # Errors
    /// As [`Network::forward`]; a network without such a place.
    pub fn features(&self, inputs: &[Batch]) -> Result<Batch> {
        let Some(layers) = self.architecture.features else {
            let hint = "m4_type has them".into();
            return Err(NetError::Missing { network: self.name.clone(), what: "features", hint });
        };
        self.evaluate(inputs, &[&self.architecture.body.chains()[0][..layers]])
    }

    /// The layers of each chain, with or without the activation at its end.
    fn chains(&self, activation: bool) -> Vec<&[Box<dyn Layer>]> {
        let last = usize::from(self.architecture.activation && !activation);
        let chains = self.architecture.body.chains().iter();
        chains.map(|chain| &chain[..chain.len() - last]).collect()
    }

    fn evaluate(&self, inputs: &[Batch], chains: &[&[Box<dyn Layer>]]) -> Result<Batch> {
        self.check(inputs)?;
        match &self.device {
            Device::Cpu => {
                let mut pass = Pass::evaluate(&self.parameters, &inputs[1..]);
                Ok(pass.network(inputs, chains))
            }
            #[cfg(any(test, feature = "gpu"))]
            Device::Gpu(gpu) => gpu.outputs(&self.parameters, inputs, chains),
        }
    }

    /// Loss and gradients of a batch in training mode; `dropout`: its random numbers, or off.
    ///
    /// # Errors
    /// Inputs or targets that do not fit.
    pub fn gradients(
        &self,
        inputs: &[Batch],
        targets: &Targets,
        loss: &Loss,
        class_weights: &[f32],
        dropout: Option<Stream>,
    ) -> Result<Gradients> {
        self.check(inputs)?;
        let (items, needed) = (inputs[0].items(), self.fewest_items());
        if items < needed {
            return Err(NetError::FewItems { network: self.name.clone(), items, needed });
        }
        let chains = self.chains(self.through_activation);
        match &self.device {
            Device::Cpu => {}
            #[cfg(any(test, feature = "gpu"))]
            Device::Gpu(gpu) => {
                let loss = |outputs: &Batch| loss.of(outputs, targets, class_weights);
                return gpu.gradients(&self.parameters, inputs, &chains, dropout, loss);
            }
        }
        let mut pass = Pass {
            parameters: &self.parameters,
            others: &inputs[1..],
            training: Some(Training::new(dropout)),
        };
        let outputs = pass.network(inputs, &chains);
        let (loss, gradient) = loss.of(&outputs, targets, class_weights)?;
        let Some(mut training) = pass.training else { unreachable!("set above") };
        let running = std::mem::take(&mut training.running);
        let mut backward = Backward::new(&self.parameters, training);
        for layers in chains.iter().rev() {
            backward.chain(layers, gradient.clone(), false);
        }
        Ok(Gradients { loss, by_parameter: backward.gradients, running, outputs })
    }

    /// Lets trainings begin with these numbers instead of random ones. The last layer stays random where
    /// it has another number of outputs; gives the names of its parameters.
    ///
    /// # Errors
    /// [`NetError::Weights`] for other differences; nothing is changed then.
    pub fn begin_with(&mut self, state: &State) -> Result<Vec<String>> {
        let random = self.parameters.adopt(&self.name, state)?;
        self.beginning = Some(state.clone());
        Ok(random)
    }

    /// What trainings begin with, where that is not random.
    pub(crate) fn beginning(&self) -> Option<&State> {
        self.beginning.as_ref()
    }

    fn begin(&mut self, declared: Vec<Declared>, seed: u64) {
        self.parameters = Parameters::new(declared, seed);
        if let Some(state) = &self.beginning
            && let Err(error) = self.parameters.adopt(&self.name, state)
        {
            unreachable!("it was adopted before: {error}");
        }
    }

    /// Starts all parameters anew.
    pub fn start(&mut self, seed: u64) {
        self.begin(self.parameters.declared().to_vec(), seed);
    }

    /// Starts every matrix and kernel anew, uniform by the sum of the numbers it takes and gives
    /// (Xavier, Glorot); vectors stay as they are, or become zero.
    pub fn start_xavier(&mut self, seed: u64, zero_vectors: bool) {
        let mut declared = self.parameters.declared().to_vec();
        for d in declared.iter_mut().filter(|d| d.trained) {
            if d.shape.len() >= 2 {
                let field: usize = d.shape[2..].iter().product();
                let sum = (d.shape[0] + d.shape[1]) * field;
                d.initial = Initial::Uniform((6.0 / sum as f32).sqrt());
            } else if zero_vectors && !matches!(d.initial, Initial::Constant(_)) {
                d.initial = Initial::Constant(0.0);
            }
        }
        self.begin(declared, seed);
    }
}
