//! Recurrent layers on a GPU: step after step over all items; those that have ended keep their state.

use burn_tensor::Tensor;
use burn_tensor::activation::sigmoid;

use super::packing::Packing;
use super::{Cell, Recurrent};
use crate::gpu::{Flow, Pass};
use crate::layers::dropout;

/// Sequences, step after step.
struct Steps {
    /// `[items, numbers]` of each step up to the last of the longest item
    each: Vec<Tensor<2>>,
    /// `[items, 1]`, 1 for items that have this step and 0 for others; none where all have it
    goes_on: Vec<Option<Tensor<2>>>,
}

impl Steps {
    fn new(x: &Tensor<3>, lengths: Option<&[usize]>, pass: &Pass<'_>) -> Self {
        let [items, padded, n] = x.dims();
        let length = |item: usize| lengths.map_or(padded, |l| l[item].clamp(1, padded));
        let longest = (0..items).map(length).max().unwrap_or(0);
        let each = (0..longest).map(|s| x.clone().narrow(1, s, 1).reshape([items, n])).collect();
        let mask = |step: usize| {
            let mask: Vec<f32> =
                (0..items).map(|i| f32::from(u8::from(length(i) > step))).collect();
            mask.contains(&0.0).then(|| pass.tensor(mask, [items, 1]))
        };
        Self { each, goes_on: (0..longest).map(mask).collect() }
    }
}

/// Hidden state, and an LSTM's cell state.
type State = (Tensor<2>, Option<Tensor<2>>);

impl Recurrent {
    /// Through all layers; the last step of the last.
    pub(super) fn last_on_gpu(&self, input: Flow, pass: &mut Pass<'_>) -> Flow {
        let Flow::Sequence(x, lengths) = input else { unreachable!("shapes were checked") };
        let [items, padded, _] = x.dims();
        let mut steps = Steps::new(&x, lengths.as_deref(), pass);
        for layer in 0..self.layers {
            if layer > 0
                && self.dropout > 0.0
                && let Some(stream) = pass.next_dropout()
            {
                // The CPU draws them for packed rows.
                let packing = Packing::new(items, padded, lengths.as_deref());
                let numbers = packing.total() * self.hidden;
                let factors = dropout::factors(stream, self.dropout, numbers);
                let factors = packing.unpack(&factors, self.hidden).into_values();
                let factors = pass.tensor(factors, [items, padded, self.hidden]);
                for (step, x) in steps.each.iter_mut().enumerate() {
                    let factors = factors.clone().narrow(1, step, 1).reshape([items, self.hidden]);
                    *x = x.clone() * factors;
                }
            }
            steps.each = self.layer_on_gpu(layer, &steps, pass);
        }
        match steps.each.pop() {
            Some(last) => Flow::Vector(last),
            None => unreachable!("sequences have steps"),
        }
    }

    /// The hidden state after each step, in the order of the steps.
    fn layer_on_gpu(&self, layer: usize, steps: &Steps, pass: &Pass<'_>) -> Vec<Tensor<2>> {
        let width = self.hidden * self.cell.gates();
        let weight =
            |what, inputs| pass.parameter(&self.key(what, layer), [width, inputs]).transpose();
        let bias = |what| pass.parameter(&self.key(what, layer), [1, width]);
        let inputs = if layer == 0 { self.inputs } else { self.hidden };
        let (of_input, of_state) = (weight("weight_ih", inputs), weight("weight_hh", self.hidden));
        let (input_bias, state_bias) = (bias("bias_ih"), bias("bias_hh"));
        let items = steps.each.first().map_or(0, |x| x.dims()[0]);
        let zeros = || pass.tensor(vec![0.0; items * self.hidden], [items, self.hidden]);
        let mut state: State = (zeros(), (self.cell == Cell::Lstm).then(zeros));
        let mut out = vec![None; steps.each.len()];
        let mut order: Vec<usize> = (0..out.len()).collect();
        if self.reverse {
            order.reverse();
        }
        for step in order {
            let by_input = steps.each[step].clone().matmul(of_input.clone()) + input_bias.clone();
            let by_state = state.0.clone().matmul(of_state.clone()) + state_bias.clone();
            let new = match &state.1 {
                None => (gru(by_input, by_state, &state.0), None),
                Some(cell) => lstm(by_input + by_state, cell),
            };
            state = match &steps.goes_on[step] {
                None => new,
                Some(mask) => {
                    let keep =
                        |old: Tensor<2>, new: Tensor<2>| old.clone() + mask.clone() * (new - old);
                    (keep(state.0, new.0), state.1.zip(new.1).map(|(old, new)| keep(old, new)))
                }
            };
            out[step] = Some(state.0.clone());
        }
        out.into_iter().flatten().collect()
    }
}

/// Part `k` of rows of several parts of `n` numbers.
fn part(x: &Tensor<2>, k: usize, n: usize) -> Tensor<2> {
    x.clone().narrow(1, k * n, n)
}

fn gru(by_input: Tensor<2>, by_state: Tensor<2>, before: &Tensor<2>) -> Tensor<2> {
    let n = before.dims()[1];
    let gate = |k| sigmoid(part(&by_input, k, n) + part(&by_state, k, n));
    let (reset, update) = (gate(0), gate(1));
    let new = (part(&by_input, 2, n) + reset * part(&by_state, 2, n)).tanh();
    new.clone() + update * (before.clone() - new)
}

fn lstm(gates: Tensor<2>, before: &Tensor<2>) -> State {
    let n = before.dims()[1];
    let gate = |k| sigmoid(part(&gates, k, n));
    let cell = gate(1) * before.clone() + gate(0) * part(&gates, 2, n).tanh();
    (gate(3) * cell.clone().tanh(), Some(cell))
}

/// Both directions side by side, zeros in the padding.
pub(super) fn both(ahead: &Recurrent, back: &Recurrent, input: Flow, pass: &Pass<'_>) -> Flow {
    let Flow::Sequence(x, lengths) = input else { unreachable!("shapes were checked") };
    let [items, padded, _] = x.dims();
    let steps = Steps::new(&x, lengths.as_deref(), pass);
    let (forth, back) = (ahead.layer_on_gpu(0, &steps, pass), back.layer_on_gpu(0, &steps, pass));
    let longest = steps.goes_on.len();
    let each = forth.into_iter().zip(back).zip(steps.goes_on).map(|((forth, back), mask)| {
        let both = Tensor::cat(vec![forth, back], 1);
        mask.into_iter().fold(both, |both, mask| both * mask)
    });
    let mut out: Tensor<3> = Tensor::stack(each.collect(), 1);
    if longest < padded {
        let (rest, n) = (padded - longest, 2 * ahead.hidden);
        let zeros = pass.tensor(vec![0.0; items * rest * n], [items, rest, n]);
        out = Tensor::cat(vec![out, zeros], 1);
    }
    Flow::Sequence(out, lengths)
}
