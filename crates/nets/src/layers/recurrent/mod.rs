//! Recurrent layers over PyTorch's stacked gates.
//!
//! Sequences are packed: step after step, longest sequence first, so that no work is done on
//! padding. All products by the input are one product for each layer; the gates of a step are one
//! pass over the numbers. After [`Recurrent`] comes the output of the last step, those of other
//! steps are not unpacked; after [`Bidirectional`] those of all steps.

mod bidirectional;
mod cell;
mod evaluation;
#[cfg(any(test, feature = "gpu"))]
mod on_gpu;
mod packing;
mod trace;

use super::uniform_by;
use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::layers::dropout;
use crate::layers::linear::column;
use crate::matrix::Matrix;
use crate::parameters::Declared;
use cell::{Cell, Gradients, States};
use packing::Packing;
use trace::LayerTrace;

pub use bidirectional::Bidirectional;
pub use trace::Trace;

/// GRU or LSTM layers, each over the outputs of the one before; the last step of the last counts.
#[derive(Clone, Debug)]
pub struct Recurrent {
    name: String,
    cell: Cell,
    inputs: usize,
    hidden: usize,
    layers: usize,
    dropout: f32,
    /// whether it goes through the steps in reverse, and its names say so
    reverse: bool,
}

impl Recurrent {
    /// `name.weight_ih_l0`, `name.weight_hh_l0`, `name.bias_ih_l0`, `name.bias_hh_l0`, …; gates
    /// reset, update, new.
    pub fn gru(name: impl Into<String>, inputs: usize, hidden: usize, layers: usize) -> Self {
        Self::new(name.into(), Cell::Gru, inputs, hidden, layers)
    }

    /// The same names; gates input, forget, cell, output.
    pub fn lstm(name: impl Into<String>, inputs: usize, hidden: usize, layers: usize) -> Self {
        Self::new(name.into(), Cell::Lstm, inputs, hidden, layers)
    }

    fn new(name: String, cell: Cell, inputs: usize, hidden: usize, layers: usize) -> Self {
        Self { name, cell, inputs, hidden, layers, dropout: 0.0, reverse: false }
    }

    /// Dropout between the layers.
    pub fn dropout(mut self, probability: f32) -> Self {
        self.dropout = probability;
        self
    }

    fn key(&self, what: &str, layer: usize) -> String {
        let reverse = if self.reverse { "_reverse" } else { "" };
        format!("{}.{what}_l{layer}{reverse}", self.name)
    }

    /// The states of all steps, which training needs; see [`evaluation`] for results alone.
    fn forward_layer(
        &self,
        layer: usize,
        input: &Matrix,
        packing: &Packing,
        pass: &Pass<'_>,
    ) -> States {
        let key = |what| self.key(what, layer);
        let gates = pass.product(input, &key("weight_ih"), &key("bias_ih"));
        let mut states = States::new(self.cell, gates, self.hidden);
        let weight = pass.parameters.get(&key("weight_hh"));
        let bias = pass.parameters.get(&key("bias_hh")).values();
        for step in 0..packing.steps() {
            let products = (step > 0).then(|| {
                let (before, n) = (packing.rows(step - 1).start, packing.rows(step).len());
                let rows = &states.hidden.values()[before * self.hidden..][..n * self.hidden];
                Matrix::new(n, self.hidden, rows.to_vec()).dot_t(weight)
            });
            let before = step.checked_sub(1).map(|s| packing.rows(s).start);
            states.step(packing.rows(step), before, products.as_ref(), bias);
        }
        states
    }

    fn backward_layer(
        &self,
        layer: usize,
        trace: &LayerTrace,
        gradient: &Matrix,
        packing: &Packing,
        pass: &mut Backward<'_>,
    ) -> Matrix {
        let hidden = self.hidden;
        let parameters = pass.parameters;
        let get = |what| parameters.get(&self.key(what, layer));
        let recurrent = get("weight_hh");
        let mut gradients = Gradients::new(self.cell, packing.total(), hidden);
        // by the hidden state, from the step after
        let mut carried = vec![0.0; packing.items() * hidden];
        for step in (0..packing.steps()).rev() {
            let rows = packing.rows(step);
            let before = step.checked_sub(1).map(|s| packing.rows(s).start);
            let n = rows.len();
            gradients.step(&trace.states, rows, before, gradient, &mut carried);
            if before.is_some() {
                let products = gradients.recurrent_rows(n).dot(recurrent);
                kernels::add(&mut carried[..n * hidden], products.values());
            }
        }
        let (by_gates, by_recurrent) = gradients.finish();
        let first = packing.rows(0).len();
        let states = packing.states_before(trace.states.hidden.values(), hidden);
        let by_recurrent = by_recurrent.as_ref().unwrap_or(&by_gates);
        let by_weight = match states {
            Some(states) => by_recurrent.t_dot_from(first, &states),
            None => Matrix::zeros(by_recurrent.cols(), hidden),
        };
        pass.add(self.key("weight_ih", layer), by_gates.t_dot(&trace.input));
        pass.add(self.key("weight_hh", layer), by_weight);
        let sums = |m: &Matrix| column(kernels::column_sums(m.values(), m.cols()));
        pass.add(self.key("bias_ih", layer), sums(&by_gates));
        pass.add(self.key("bias_hh", layer), sums(by_recurrent));
        if layer == 0 && !pass.wanted {
            return by_gates;
        }
        by_gates.dot(get("weight_ih"))
    }
}

impl Layer for Recurrent {
    fn drops(&self) -> bool {
        self.layers > 1 && self.dropout > 0.0
    }

    fn describe(&self) -> String {
        let Self { name, inputs, hidden, layers, .. } = self;
        let mut text = format!(
            "{name}: {layers} {} layers, {inputs} to {hidden}, last step",
            self.cell.name()
        );
        if self.dropout > 0.0 {
            text += &format!(", dropout {} between", self.dropout);
        }
        text
    }

    fn parameters(&self) -> Vec<Declared> {
        let (initial, gates) = (uniform_by(self.hidden), self.cell.gates() * self.hidden);
        let one = |layer| {
            let inputs = if layer == 0 { self.inputs } else { self.hidden };
            [
                Declared::trained(self.key("weight_ih", layer), &[gates, inputs], initial),
                Declared::trained(self.key("weight_hh", layer), &[gates, self.hidden], initial),
                Declared::trained(self.key("bias_ih", layer), &[gates], initial),
                Declared::trained(self.key("bias_hh", layer), &[gates], initial),
            ]
        };
        (0..self.layers).flat_map(one).collect()
    }

    fn kept(&self, input: Shape) -> usize {
        // Gates and states of each layer, and the gradients by the gates.
        input.places() * self.hidden * self.layers * (2 * self.cell.gates() + 2)
    }

    fn passing(&self, input: Shape) -> usize {
        // Beside the input, a stretch of steps, whose size does not grow with the item.
        input.len() + self.layers * self.hidden * (self.cell.gates() + 8)
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        match input {
            Shape::Sequence { numbers, .. } if numbers == self.inputs => {
                Ok(Shape::Vector(self.hidden))
            }
            _ => Err(NetError::layer(
                self.describe(),
                format!("steps of {} numbers", self.inputs),
                input,
            )),
        }
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let (steps, items) = (input.shape.places(), input.items());
        let packing = Packing::new(items, steps, input.lengths.as_deref());
        if pass.training.is_none() {
            let last = self.last(input.values.values(), &packing, pass.parameters);
            return Batch { values: last, shape: Shape::Vector(self.hidden), lengths: None };
        }
        let mut values = packing.pack(input.values.values(), self.inputs);
        let mut layers = Vec::new();
        for layer in 0..self.layers {
            let mut kept = Vec::new();
            if layer > 0 && self.dropout > 0.0 {
                let stream = pass.training.as_mut().and_then(|t| t.next_dropout());
                if let Some(stream) = stream {
                    kept = dropout::kept(stream, self.dropout, values.values().len());
                    dropout::apply(values.values_mut(), &kept, self.dropout);
                }
            }
            let states = self.forward_layer(layer, &values, &packing, pass);
            let output = states.hidden.clone();
            layers.push(LayerTrace { input: values, states, kept });
            values = output;
        }
        let last = packing.last(values.values(), self.hidden);
        let Batch { shape, lengths, .. } = input;
        pass.save(|| Saved::Recurrent(Box::new(Trace { packing, layers, shape, lengths })));
        Batch { values: last, shape: Shape::Vector(self.hidden), lengths: None }
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Recurrent(trace) = pass.saved() else { unreachable!("saves its states") };
        let packing = &trace.packing;
        let mut values = packing.only_last(gradient.values.values(), self.hidden);
        for (layer, states) in trace.layers.iter().enumerate().rev() {
            values = self.backward_layer(layer, states, &values, packing, pass);
            if !states.kept.is_empty() {
                dropout::apply(values.values_mut(), &states.kept, self.dropout);
            }
        }
        if !pass.wanted {
            return gradient;
        }
        let values = packing.unpack(values.values(), self.inputs);
        Batch { values, shape: trace.shape, lengths: trace.lengths }
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        self.last_on_gpu(input, pass)
    }
}
