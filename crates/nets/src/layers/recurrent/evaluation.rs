//! Results alone: a stretch of steps passes all layers before the next does, so that memory does not grow with the
//! length of the sequences, and what layers hand on stays in the cache.

use std::ops::Range;

use super::Recurrent;
use super::cell::{Before, State};
use super::packing::Packing;
use crate::matrix::Matrix;
use crate::packed::Packed;
use crate::parameters::Parameters;

/// Numbers of gates that a stretch has, about; few in tests, so that there are several.
const STRETCH: usize = if cfg!(test) { 1 << 8 } else { 1 << 20 };

/// A layer with its weights, and where it is.
struct Running<'a> {
    settings: &'a Recurrent,
    by_input: &'a Packed,
    input_bias: &'a [f32],
    by_hidden: &'a Packed,
    hidden_bias: &'a [f32],
    /// products by the input, then gates, of a stretch
    gates: Vec<f32>,
    /// recurrent products of a step
    products: Vec<f32>,
    /// states of the last step of the stretch before, then those of a stretch
    inner: Vec<f32>,
    hidden: Vec<f32>,
    /// items of the last step of the stretch before
    before: usize,
}

impl<'a> Running<'a> {
    fn new(settings: &'a Recurrent, layer: usize, parameters: &'a Parameters) -> Self {
        let packed = |what| parameters.packed(&settings.key(what, layer), Packed::new);
        let bias = |what| parameters.get(&settings.key(what, layer)).values();
        Self {
            settings,
            by_input: packed("weight_ih"),
            input_bias: bias("bias_ih"),
            by_hidden: packed("weight_hh"),
            hidden_bias: bias("bias_hh"),
            gates: Vec::new(),
            products: Vec::new(),
            inner: Vec::new(),
            hidden: Vec::new(),
            before: 0,
        }
    }

    /// The outputs of these steps from the packed rows that they see.
    fn stretch(&mut self, steps: Range<usize>, input: &[f32], packing: &Packing) -> &[f32] {
        let n = self.settings.hidden;
        let width = n * self.settings.cell.gates();
        let first = packing.rows(steps.start).start;
        let rows = packing.rows(steps.end - 1).end - first;
        self.gates.resize(rows * width, 0.0);
        self.by_input.product_into(input, Some(self.input_bias), &mut self.gates);
        // What the last stretch ended with comes to the front.
        for states in [&mut self.inner, &mut self.hidden] {
            states.drain(..states.len() - self.before * n);
            states.resize((self.before + rows) * n, 0.0);
        }
        let mut before = 0..self.before;
        for step in steps {
            let gates = packing.rows(step);
            let gates = gates.start - first..gates.end - first;
            let (now, count) = (self.before + gates.start, gates.len());
            let (inner_before, inner) = self.inner.split_at_mut(now * n);
            let (hidden_before, hidden) = self.hidden.split_at_mut(now * n);
            let going_on = before.start * n..(before.start + count) * n;
            let before_this = (step > 0).then(|| {
                let hidden = &hidden_before[going_on.clone()];
                self.products.resize(count * width, 0.0);
                self.by_hidden.product_into(hidden, None, &mut self.products);
                Before { inner: &inner_before[going_on], hidden, products: &self.products }
            });
            let state = State { inner: &mut inner[..count * n], hidden: &mut hidden[..count * n] };
            let gates = &mut self.gates[gates.start * width..gates.end * width];
            self.settings.cell.step(n, gates, before_this, self.hidden_bias, state);
            before = now..now + count;
        }
        let outputs = self.before * n;
        self.before = before.len();
        &self.hidden[outputs..]
    }
}

impl Recurrent {
    /// The output of the last step of every item: `[items, hidden]`.
    pub(super) fn last(
        &self,
        values: &[f32],
        packing: &Packing,
        parameters: &Parameters,
    ) -> Matrix {
        let mut layers: Vec<Running<'_>> =
            (0..self.layers).map(|layer| Running::new(self, layer, parameters)).collect();
        let mut out = Matrix::zeros(packing.items(), self.hidden);
        for steps in packing.stretches(self.rows_together()) {
            let packed = packing.pack_steps(steps.clone(), values, self.inputs);
            let outputs = layers
                .iter_mut()
                .fold(packed.values(), |input, layer| layer.stretch(steps.clone(), input, packing));
            packing.last_of_steps(steps, outputs, self.hidden, &mut out);
        }
        out
    }

    /// The outputs of the first layer at all steps, from packed rows to packed rows.
    pub(super) fn all(
        &self,
        values: &Matrix,
        packing: &Packing,
        parameters: &Parameters,
    ) -> Matrix {
        let mut layer = Running::new(self, 0, parameters);
        let mut out = Vec::with_capacity(packing.total() * self.hidden);
        for steps in packing.stretches(self.rows_together()) {
            let (from, to) = (packing.rows(steps.start).start, packing.rows(steps.end - 1).end);
            let input = &values.values()[from * self.inputs..to * self.inputs];
            out.extend_from_slice(layer.stretch(steps, input, packing));
        }
        Matrix::new(packing.total(), self.hidden, out)
    }

    fn rows_together(&self) -> usize {
        STRETCH / (self.hidden * self.cell.gates())
    }
}
