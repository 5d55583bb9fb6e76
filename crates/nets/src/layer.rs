//! What a layer is.

use std::collections::HashMap;
use std::fmt::Debug;

use rayon::prelude::*;

use crate::batch::{Batch, Shape};
use crate::error::Result;
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layers::dropout::Draws;
use crate::matrix::Matrix;
use crate::packed::Packed;
use crate::parameters::{Declared, Parameters};
use crate::random::Stream;

/// A step of a network. Layers hold their settings; their numbers lie in [`Parameters`].
pub trait Layer: Debug + Send + Sync {
    /// Name and settings, for people.
    fn describe(&self) -> String;

    /// Its parameters under PyTorch's names.
    fn parameters(&self) -> Vec<Declared> {
        Vec::new()
    }

    /// Shape of an item after it.
    ///
    /// # Errors
    /// [`crate::NetError::LayerInput`] for a shape that it cannot take.
    fn output(&self, input: Shape) -> Result<Shape>;

    /// Whether it drops numbers in training.
    fn drops(&self) -> bool {
        false
    }

    /// Items that a training step needs at least.
    fn fewest_items(&self, _: Shape) -> usize {
        1
    }

    /// Numbers that a training step holds for each item on account of this layer, roughly: what comes
    /// after it, and the gradient by that.
    fn kept(&self, input: Shape) -> usize {
        self.output(input).map_or(0, |output| 2 * output.len())
    }

    /// Numbers that evaluation holds for each item while this layer works, roughly: what comes before and after it.
    fn passing(&self, input: Shape) -> usize {
        input.len() + self.output(input).map_or(0, Shape::len)
    }

    /// Numbers after it. In training it leaves on the tape what [`Layer::backward`] needs.
    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch;

    /// From the gradient by its output to the gradient by its input; gradients by its parameters go
    /// to `pass`.
    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch;

    /// The way forward on a GPU, from which the way back follows.
    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow;
}

/// Layers one after another.
pub type Chain = Vec<Box<dyn Layer>>;

/// Each layer with the shape that reaches it.
fn with_inputs(
    layers: &[Box<dyn Layer>],
    input: Shape,
) -> impl Iterator<Item = (&dyn Layer, Shape)> {
    layers.iter().scan(input, |shape, layer| {
        let before = *shape;
        *shape = layer.output(before).unwrap_or(before);
        Some((layer.as_ref(), before))
    })
}

/// Items that a training step needs at least on account of these layers.
pub(crate) fn fewest_for(layers: &[Box<dyn Layer>], input: Shape) -> usize {
    with_inputs(layers, input).map(|(layer, shape)| layer.fewest_items(shape)).max().unwrap_or(1)
}

/// Numbers that a training step holds for each item on account of these layers; see [`Layer::kept`].
pub(crate) fn kept_by(layers: &[Box<dyn Layer>], input: Shape) -> usize {
    with_inputs(layers, input).map(|(layer, shape)| layer.kept(shape)).sum()
}

/// Numbers that evaluation holds for each item while the largest of these layers works; see [`Layer::passing`].
pub(crate) fn passing_by(layers: &[Box<dyn Layer>], input: Shape) -> usize {
    with_inputs(layers, input).map(|(layer, shape)| layer.passing(shape)).max().unwrap_or(0)
}

/// A way through the network.
#[derive(Debug)]
pub struct Pass<'a> {
    /// the network's numbers
    pub parameters: &'a Parameters,
    /// inputs beyond the first
    pub others: &'a [Batch],
    /// set in training
    pub training: Option<Training>,
}

/// What training keeps of a way through the network.
#[derive(Debug)]
pub struct Training {
    dropout: Draws,
    tape: Vec<Saved>,
    /// new running statistics
    pub running: Vec<(String, Vec<f32>)>,
}

impl Training {
    /// An empty tape. `dropout`: its random numbers in this step, or off.
    pub fn new(dropout: Option<Stream>) -> Self {
        Self { dropout: Draws::new(dropout), tape: Vec::new(), running: Vec::new() }
    }

    /// Random numbers of the next dropout layer, when dropout is on.
    pub fn next_dropout(&mut self) -> Option<Stream> {
        self.dropout.next_layer()
    }
}

impl<'a> Pass<'a> {
    /// For results alone.
    pub fn evaluate(parameters: &'a Parameters, others: &'a [Batch]) -> Self {
        Self { parameters, others, training: None }
    }

    /// Keeps something for the way back, in training.
    pub fn save(&mut self, saved: impl FnOnce() -> Saved) {
        if let Some(training) = &mut self.training {
            training.tape.push(saved());
        }
    }

    /// Rows of numbers times the transposed weights of this name, plus the bias of that name. In training the product
    /// is burn's: weights that change with every step would have to be packed every time.
    pub(crate) fn product(&self, rows: &Matrix, weight: &str, bias: &str) -> Matrix {
        let bias = self.parameters.get(bias).values();
        if self.training.is_none() {
            let packed = self.parameters.packed(weight, Packed::new);
            return packed.product(rows.values(), Some(bias));
        }
        let mut out = rows.dot_t(self.parameters.get(weight));
        kernels::add_to_rows(out.values_mut(), bias);
        out
    }

    /// Through all layers of a chain.
    pub fn chain(&mut self, layers: &[Box<dyn Layer>], input: Batch) -> Batch {
        layers.iter().fold(input, |x, layer| layer.forward(x, self))
    }

    /// Through the layers of each input; the sum of what comes after them.
    pub(crate) fn network(&mut self, inputs: &[Batch], chains: &[&[Box<dyn Layer>]]) -> Batch {
        let mut out = self.through_input(chains[0], inputs[0].clone());
        for (layers, input) in chains.iter().zip(inputs).skip(1) {
            let more = self.through_input(layers, input.clone());
            kernels::add(out.values.values_mut(), more.values.values());
        }
        out
    }

    /// Through the layers of an input. In evaluation, few images at a time pass those layers that keep them images:
    /// what passes between layers stays in the cache. Later layers take all, so that their weights are read once.
    fn through_input(&mut self, layers: &[Box<dyn Layer>], input: Batch) -> Batch {
        let images = match self.training {
            None => image_layers(layers, input.shape),
            Some(_) => 0,
        };
        let (first, rest) = layers.split_at(images);
        let together = (PASSING / passing_by(first, input.shape).max(1)).max(1);
        if first.is_empty() || together >= input.items() {
            return self.chain(layers, input);
        }
        let parameters = self.parameters;
        let through = |images: &[f32]| {
            let images = Batch::new(images.to_vec(), input.shape);
            Pass::evaluate(parameters, &[]).chain(first, images)
        };
        let (each, mut left) = (together * input.shape.len(), input.values.values());
        let mut groups = Vec::with_capacity(input.items().div_ceil(together));
        // One alone packs the weights; side by side, each would pack them all.
        if !parameters.has_packed() {
            let (one, others) = left.split_at(each);
            groups.push(through(one));
            left = others;
        }
        groups.par_extend(left.par_chunks(each).map(through));
        let shape = groups[0].shape;
        let values: Vec<&[f32]> = groups.iter().map(|group| group.values.values()).collect();
        self.chain(rest, Batch::new(values.concat(), shape))
    }
}

/// Numbers of images that pass a layer together in evaluation, about.
const PASSING: usize = 1 << 21;

/// How many layers at the beginning make images of images.
fn image_layers(layers: &[Box<dyn Layer>], input: Shape) -> usize {
    let mut shape = input;
    let keeps = |layer: &dyn Layer| {
        let before = shape;
        shape = layer.output(shape).unwrap_or(Shape::Vector(0));
        [before, shape].iter().all(|shape| matches!(shape, Shape::Image { .. }))
    };
    layers.iter().map(Box::as_ref).map(keeps).take_while(|keeps| *keeps).count()
}

/// What a layer keeps for the way back.
#[derive(Debug)]
pub enum Saved {
    /// a batch: input or output
    Batch(Batch),
    /// matrices of a layer's own
    Matrices(Vec<Matrix>),
    /// indices or flags
    Bytes(Vec<u8>, Shape),
    /// only the shape and the lengths
    Shape(Shape, Option<Vec<usize>>),
    /// a recurrent layer's states
    Recurrent(Box<crate::layers::recurrent::Trace>),
}

/// The way back.
#[derive(Debug)]
pub struct Backward<'a> {
    /// the network's numbers
    pub parameters: &'a Parameters,
    tape: Vec<Saved>,
    /// gradients by the parameters' names
    pub gradients: HashMap<String, Matrix>,
    /// whether anything needs the gradient by the input of the layer at work
    pub wanted: bool,
}

impl<'a> Backward<'a> {
    /// After a forward pass.
    pub fn new(parameters: &'a Parameters, training: Training) -> Self {
        Self { parameters, tape: training.tape, gradients: HashMap::new(), wanted: true }
    }

    /// What the layer saved last.
    ///
    /// # Panics
    /// When forward saved less than backward takes: a fault of the layer.
    pub fn saved(&mut self) -> Saved {
        match self.tape.pop() {
            Some(saved) => saved,
            None => unreachable!("a layer saved less than it takes back"),
        }
    }

    /// Adds to a parameter's gradient.
    pub fn add(&mut self, name: String, gradient: Matrix) {
        match self.gradients.entry(name) {
            std::collections::hash_map::Entry::Vacant(place) => {
                place.insert(gradient);
            }
            std::collections::hash_map::Entry::Occupied(mut sum) => {
                kernels::add(sum.get_mut().values_mut(), gradient.values());
            }
        }
    }

    /// Back through a chain; `wanted`: whether the gradient by its input is needed.
    pub fn chain(&mut self, layers: &[Box<dyn Layer>], gradient: Batch, wanted: bool) -> Batch {
        let outer = self.wanted;
        let mut gradient = gradient;
        for (i, layer) in layers.iter().enumerate().rev() {
            self.wanted = wanted || i > 0;
            gradient = layer.backward(gradient, self);
        }
        self.wanted = outer;
        gradient
    }
}
