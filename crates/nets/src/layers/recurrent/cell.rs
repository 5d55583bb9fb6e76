//! The gates of a step, forward and back, each one pass over the numbers.

use std::ops::Range;

use rayon::prelude::*;

use crate::kernels::{sigmoid, tanh, vectorized};
use crate::matrix::Matrix;

/// Kind of a recurrent layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    Gru,
    Lstm,
}

impl Cell {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Gru => "GRU",
            Self::Lstm => "LSTM",
        }
    }

    pub(super) fn gates(self) -> usize {
        match self {
            Self::Gru => 3,
            Self::Lstm => 4,
        }
    }
}

/// Fewest rows of a piece of work for a thread.
const ROWS: usize = 16;

/// What a layer computes, a row for each step of each item.
#[derive(Debug)]
pub(super) struct States {
    cell: Cell,
    /// before a step the products by the input, after it the gates themselves
    gates: Matrix,
    /// GRU: the recurrent part of the new state; LSTM: the cell state
    inner: Matrix,
    /// the output
    pub(super) hidden: Matrix,
}

impl States {
    /// From the products by the input.
    pub(super) fn new(cell: Cell, gates: Matrix, hidden: usize) -> Self {
        let rows = gates.rows();
        let inner = Matrix::zeros(rows, hidden);
        Self { cell, gates, inner, hidden: Matrix::zeros(rows, hidden) }
    }

    /// One step: `rows` are its rows, `before` is where the rows of the step before begin,
    /// `products` are the recurrent ones without `bias`; neither at the first step.
    pub(super) fn step(
        &mut self,
        rows: Range<usize>,
        before: Option<usize>,
        products: Option<&Matrix>,
        bias: &[f32],
    ) {
        let n = self.hidden.cols();
        let width = n * self.cell.gates();
        let gates = &mut self.gates.values_mut()[rows.start * width..rows.end * width];
        let (inner_before, inner) = split(self.inner.values_mut(), &rows, before, n);
        let (hidden_before, hidden) = split(self.hidden.values_mut(), &rows, before, n);
        let before = inner_before
            .zip(hidden_before)
            .zip(products)
            .map(|((inner, hidden), p)| Before { inner, hidden, products: p.values() });
        self.cell.step(n, gates, before, bias, State { inner, hidden });
    }
}

/// What a step makes, a row for each item: see [`States`].
#[derive(Debug)]
pub(super) struct State<'a> {
    pub(super) inner: &'a mut [f32],
    pub(super) hidden: &'a mut [f32],
}

/// What the step before made, with the recurrent products without their bias.
#[derive(Clone, Copy, Debug)]
pub(super) struct Before<'a> {
    pub(super) inner: &'a [f32],
    pub(super) hidden: &'a [f32],
    pub(super) products: &'a [f32],
}

impl Before<'_> {
    fn row(self, i: usize, n: usize, width: usize) -> Self {
        Self {
            inner: &self.inner[i * n..(i + 1) * n],
            hidden: &self.hidden[i * n..(i + 1) * n],
            products: &self.products[i * width..(i + 1) * width],
        }
    }
}

impl Cell {
    /// One step of `n` numbers an item. `gates` are the products by the input, and become the gates themselves;
    /// nothing is `before` the first step.
    pub(super) fn step(
        self,
        n: usize,
        gates: &mut [f32],
        before: Option<Before<'_>>,
        bias: &[f32],
        state: State<'_>,
    ) {
        let width = n * self.gates();
        let zeros = vec![0.0; width];
        let zeros = Before { inner: &zeros[..n], hidden: &zeros[..n], products: &zeros };
        let states = state.inner.par_chunks_mut(n).zip(state.hidden.par_chunks_mut(n));
        let all = gates.par_chunks_mut(width).zip(states).enumerate().with_min_len(ROWS);
        all.for_each(|(i, (gates, (inner, hidden)))| {
            let before = before.map_or(zeros, |before| before.row(i, n, width));
            match self {
                Self::Gru => gru(gates, before.products, bias, before.hidden, inner, hidden),
                Self::Lstm => lstm(gates, before.products, bias, before.inner, inner, hidden),
            }
        });
    }
}

/// The rows of the step before, and those of this step.
fn split<'a>(
    values: &'a mut [f32],
    rows: &Range<usize>,
    before: Option<usize>,
    n: usize,
) -> (Option<&'a [f32]>, &'a mut [f32]) {
    let (done, rest) = values.split_at_mut(rows.start * n);
    let done: &[f32] = done;
    (before.map(|b| &done[b * n..]), &mut rest[..rows.len() * n])
}

/// Three parts of `n` numbers.
#[inline(always)]
fn thirds(row: &[f32]) -> (&[f32], &[f32], &[f32]) {
    let n = row.len() / 3;
    let (a, rest) = row.split_at(n);
    let (b, c) = rest.split_at(n);
    (a, b, c)
}

fn gru(
    gates: &mut [f32],
    p: &[f32],
    bias: &[f32],
    before: &[f32],
    new: &mut [f32],
    out: &mut [f32],
) {
    let n = out.len();
    let (reset, rest) = gates.split_at_mut(n);
    let (update, state) = rest.split_at_mut(n);
    let (pr, pz, pn) = thirds(p);
    let (br, bz, bn) = thirds(bias);
    vectorized(
        #[inline(always)]
        || {
            let (reset, update, state) = (&mut reset[..n], &mut update[..n], &mut state[..n]);
            let (pr, pz, pn) = (&pr[..n], &pz[..n], &pn[..n]);
            let (br, bz, bn) = (&br[..n], &bz[..n], &bn[..n]);
            let (before, new) = (&before[..n], &mut new[..n]);
            for i in 0..n {
                let r = sigmoid(reset[i] + pr[i] + br[i]);
                let z = sigmoid(update[i] + pz[i] + bz[i]);
                let recurrent = pn[i] + bn[i];
                let s = tanh(state[i] + r * recurrent);
                reset[i] = r;
                update[i] = z;
                state[i] = s;
                new[i] = recurrent;
                out[i] = s + z * (before[i] - s);
            }
        },
    );
}

fn lstm(
    gates: &mut [f32],
    p: &[f32],
    bias: &[f32],
    before: &[f32],
    cell: &mut [f32],
    out: &mut [f32],
) {
    let n = out.len();
    let (input, rest) = gates.split_at_mut(n);
    let (forget, rest) = rest.split_at_mut(n);
    let (state, output) = rest.split_at_mut(n);
    vectorized(
        #[inline(always)]
        || {
            let (input, forget) = (&mut input[..n], &mut forget[..n]);
            let (state, output) = (&mut state[..n], &mut output[..n]);
            let (before, cell) = (&before[..n], &mut cell[..n]);
            let (p, bias) = (&p[..4 * n], &bias[..4 * n]);
            for k in 0..n {
                let i = sigmoid(input[k] + p[k] + bias[k]);
                let f = sigmoid(forget[k] + p[n + k] + bias[n + k]);
                let g = tanh(state[k] + p[2 * n + k] + bias[2 * n + k]);
                let o = sigmoid(output[k] + p[3 * n + k] + bias[3 * n + k]);
                let c = f * before[k] + i * g;
                input[k] = i;
                forget[k] = f;
                state[k] = g;
                output[k] = o;
                cell[k] = c;
                out[k] = o * tanh(c);
            }
        },
    );
}

/// Gradients by the gates, filled from the last step to the first.
#[derive(Debug)]
pub(super) struct Gradients {
    cell: Cell,
    hidden: usize,
    /// by the products with the input
    by_gates: Matrix,
    /// by the recurrent products where they differ (GRU's reset gate scales them)
    by_recurrent: Option<Matrix>,
    /// by the cell state, from the step after (LSTM)
    carried_cell: Vec<f32>,
    /// by the recurrent products at the step at work
    step: Vec<f32>,
}

impl Gradients {
    pub(super) fn new(cell: Cell, rows: usize, hidden: usize) -> Self {
        let zeros = || Matrix::zeros(rows, hidden * cell.gates());
        let by_recurrent = (cell == Cell::Gru).then(zeros);
        let (carried_cell, step) = (Vec::new(), Vec::new());
        Self { cell, hidden, by_gates: zeros(), by_recurrent, carried_cell, step }
    }

    /// One step. `carried` is the gradient by the hidden state from the step after; it becomes the
    /// part that goes to the step before without a product.
    pub(super) fn step(
        &mut self,
        states: &States,
        rows: Range<usize>,
        before: Option<usize>,
        gradient: &Matrix,
        carried: &mut [f32],
    ) {
        let (n, cell, count) = (self.hidden, self.cell, rows.len());
        let width = n * cell.gates();
        let zeros = vec![0.0; n];
        let gates = &states.gates.values()[rows.start * width..rows.end * width];
        let of = |m: &'_ Matrix, start: usize| -> Range<usize> {
            debug_assert!(m.cols() == n);
            start * n..(start + count) * n
        };
        let inner = &states.inner.values()[of(&states.inner, rows.start)];
        let earlier = match cell {
            Cell::Gru => &states.hidden,
            Cell::Lstm => &states.inner,
        };
        let earlier = before.map(|b| &earlier.values()[of(earlier, b)]);
        let gradient = &gradient.values()[of(gradient, rows.start)];
        if self.carried_cell.is_empty() {
            self.carried_cell = vec![0.0; if cell == Cell::Lstm { carried.len() } else { 0 }];
        }
        let by_gates = &mut self.by_gates.values_mut()[rows.start * width..rows.end * width];
        match (cell, &mut self.by_recurrent) {
            (Cell::Gru, Some(by_recurrent)) => {
                let by_recurrent =
                    &mut by_recurrent.values_mut()[rows.start * width..rows.end * width];
                by_gates
                    .par_chunks_mut(width)
                    .zip(by_recurrent.par_chunks_mut(width))
                    .zip(carried.par_chunks_mut(n))
                    .enumerate()
                    .with_min_len(ROWS)
                    .for_each(|(i, ((by_gates, by_recurrent), carried))| {
                        let row = i * n..(i + 1) * n;
                        let before = earlier.map_or(&zeros[..], |e| &e[row.clone()]);
                        let gates = &gates[i * width..(i + 1) * width];
                        let (new, gradient) = (&inner[row.clone()], &gradient[row]);
                        gru_back(gates, new, before, gradient, carried, by_gates, by_recurrent);
                    });
                self.step.clear();
                self.step.extend_from_slice(by_recurrent);
            }
            _ => {
                by_gates
                    .par_chunks_mut(width)
                    .zip(self.carried_cell.par_chunks_mut(n))
                    .zip(carried.par_chunks_mut(n))
                    .enumerate()
                    .with_min_len(ROWS)
                    .for_each(|(i, ((by_gates, carried_cell), carried))| {
                        let row = i * n..(i + 1) * n;
                        let before = earlier.map_or(&zeros[..], |e| &e[row.clone()]);
                        let gates = &gates[i * width..(i + 1) * width];
                        let (cell, gradient) = (&inner[row.clone()], &gradient[row]);
                        lstm_back(gates, cell, before, gradient, carried, carried_cell, by_gates);
                    });
                self.step.clear();
                self.step.extend_from_slice(by_gates);
            }
        }
    }

    /// Gradients by the recurrent products of the step just done, `n` rows.
    pub(super) fn recurrent_rows(&mut self, n: usize) -> Matrix {
        Matrix::new(n, self.hidden * self.cell.gates(), std::mem::take(&mut self.step))
    }

    /// Gradients by the products with the input, and by the recurrent ones where they differ.
    pub(super) fn finish(self) -> (Matrix, Option<Matrix>) {
        (self.by_gates, self.by_recurrent)
    }
}

fn gru_back(
    gates: &[f32],
    new: &[f32],
    before: &[f32],
    gradient: &[f32],
    carried: &mut [f32],
    by_gates: &mut [f32],
    by_recurrent: &mut [f32],
) {
    let n = new.len();
    let (r, z, s) = thirds(gates);
    vectorized(
        #[inline(always)]
        || {
            let (r, z, s) = (&r[..n], &z[..n], &s[..n]);
            let (before, gradient, carried) = (&before[..n], &gradient[..n], &mut carried[..n]);
            let (by_gates, by_recurrent) = (&mut by_gates[..3 * n], &mut by_recurrent[..3 * n]);
            for i in 0..n {
                let by_out = gradient[i] + carried[i];
                let by_state = by_out * (1.0 - z[i]) * (1.0 - s[i] * s[i]);
                let by_update = by_out * (before[i] - s[i]) * z[i] * (1.0 - z[i]);
                let by_reset = by_state * new[i] * r[i] * (1.0 - r[i]);
                by_gates[i] = by_reset;
                by_gates[n + i] = by_update;
                by_gates[2 * n + i] = by_state;
                by_recurrent[i] = by_reset;
                by_recurrent[n + i] = by_update;
                by_recurrent[2 * n + i] = by_state * r[i];
                carried[i] = by_out * z[i];
            }
        },
    );
}

fn lstm_back(
    gates: &[f32],
    cell: &[f32],
    before: &[f32],
    gradient: &[f32],
    carried: &mut [f32],
    carried_cell: &mut [f32],
    by_gates: &mut [f32],
) {
    let n = cell.len();
    vectorized(
        #[inline(always)]
        || {
            let (gates, by_gates) = (&gates[..4 * n], &mut by_gates[..4 * n]);
            let (before, gradient) = (&before[..n], &gradient[..n]);
            let (carried, carried_cell) = (&mut carried[..n], &mut carried_cell[..n]);
            for k in 0..n {
                let (i, f, g, o) = (gates[k], gates[n + k], gates[2 * n + k], gates[3 * n + k]);
                let by_out = gradient[k] + carried[k];
                let squashed = tanh(cell[k]);
                let by_cell = carried_cell[k] + by_out * o * (1.0 - squashed * squashed);
                by_gates[k] = by_cell * g * i * (1.0 - i);
                by_gates[n + k] = by_cell * before[k] * f * (1.0 - f);
                by_gates[2 * n + k] = by_cell * i * (1.0 - g * g);
                by_gates[3 * n + k] = by_out * squashed * o * (1.0 - o);
                carried_cell[k] = by_cell * f;
                carried[k] = 0.0;
            }
        },
    );
}
