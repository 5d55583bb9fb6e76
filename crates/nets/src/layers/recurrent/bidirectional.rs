//! A recurrent layer in both directions.

#[cfg(any(test, feature = "gpu"))]
use super::on_gpu;
use super::packing::Packing;
use super::trace::{LayerTrace, Trace};
use super::{Layer, Recurrent};
use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Pass, Saved};
use crate::matrix::Matrix;
use crate::parameters::Declared;

/// A GRU over the steps and another over the steps in reverse; their outputs at each step lie side by side.
#[derive(Clone, Debug)]
pub struct Bidirectional {
    ahead: Recurrent,
    back: Recurrent,
}

impl Bidirectional {
    /// The names of [`Recurrent::gru`] and the same with `_reverse`; `hidden` numbers in each direction.
    pub fn gru(name: impl Into<String>, inputs: usize, hidden: usize) -> Self {
        let ahead = Recurrent::gru(name, inputs, hidden, 1);
        Self { back: Recurrent { reverse: true, ..ahead.clone() }, ahead }
    }

    fn directions(&self) -> [&Recurrent; 2] {
        [&self.ahead, &self.back]
    }
}

impl Layer for Bidirectional {
    fn describe(&self) -> String {
        let Recurrent { name, cell, inputs, hidden, .. } = &self.ahead;
        format!("{name}: {} in both directions, {inputs} to 2 x {hidden}, all steps", cell.name())
    }

    fn parameters(&self) -> Vec<Declared> {
        self.directions().iter().flat_map(|direction| direction.parameters()).collect()
    }

    fn kept(&self, input: Shape) -> usize {
        // States and input of each direction; outputs, their gradients and those of one direction apart.
        2 * (self.ahead.kept(input) + input.len()) + 8 * input.places() * self.ahead.hidden
    }

    fn passing(&self, input: Shape) -> usize {
        // The input packed and in reverse; outputs of each direction, in order, together and unpacked.
        3 * input.len() + 7 * input.places() * self.ahead.hidden
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        match input {
            Shape::Sequence { numbers, .. } if numbers == self.ahead.inputs => {
                Ok(input.with_numbers(2 * self.ahead.hidden))
            }
            _ => {
                let expected = format!("steps of {} numbers", self.ahead.inputs);
                Err(NetError::layer(self.describe(), expected, input))
            }
        }
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let hidden = self.ahead.hidden;
        let Batch { values, shape, lengths } = input;
        let items = values.rows() / shape.places().max(1);
        let packing = Packing::new(items, shape.places(), lengths.as_deref());
        let values = packing.pack(values.values(), self.ahead.inputs);
        let reversed = packing.reversed(&values);
        let shaped = |both: &Matrix, lengths| Batch {
            values: packing.unpack(both.values(), 2 * hidden),
            shape: shape.with_numbers(2 * hidden),
            lengths,
        };
        if pass.training.is_none() {
            let ahead = self.ahead.all(&values, &packing, pass.parameters);
            let back = self.back.all(&reversed, &packing, pass.parameters);
            return shaped(&side_by_side(&ahead, &packing.reversed(&back)), lengths);
        }
        let ahead = self.ahead.forward_layer(0, &values, &packing, pass);
        let back = self.back.forward_layer(0, &reversed, &packing, pass);
        let both = side_by_side(&ahead.hidden, &packing.reversed(&back.hidden));
        let out = shaped(&both, lengths.clone());
        pass.save(|| {
            let layers = [(values, ahead), (reversed, back)];
            let layers = layers.map(|(input, states)| LayerTrace { input, states, kept: vec![] });
            Saved::Recurrent(Box::new(Trace { packing, layers: layers.into(), shape, lengths }))
        });
        out
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Recurrent(trace) = pass.saved() else { unreachable!("saves its states") };
        let packing = &trace.packing;
        let both = packing.pack(gradient.values.values(), 2 * self.ahead.hidden);
        let [ahead, back] = halves(&both);
        let by_ahead = self.ahead.backward_layer(0, &trace.layers[0], &ahead, packing, pass);
        let back = packing.reversed(&back);
        let by_back = self.back.backward_layer(0, &trace.layers[1], &back, packing, pass);
        if !pass.wanted {
            return gradient;
        }
        let mut sum = by_ahead;
        kernels::add(sum.values_mut(), packing.reversed(&by_back).values());
        let values = packing.unpack(sum.values(), self.ahead.inputs);
        Batch { values, shape: trace.shape, lengths: trace.lengths }
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        let [ahead, back] = self.directions();
        on_gpu::both(ahead, back, input, pass)
    }
}

/// `[rows, n]` twice to `[rows, 2 n]`.
fn side_by_side(left: &Matrix, right: &Matrix) -> Matrix {
    let n = left.cols();
    let mut out = Vec::with_capacity(2 * left.values().len());
    for (l, r) in left.values().chunks_exact(n).zip(right.values().chunks_exact(n)) {
        out.extend_from_slice(l);
        out.extend_from_slice(r);
    }
    Matrix::new(left.rows(), 2 * n, out)
}

/// `[rows, 2 n]` to `[rows, n]` twice.
fn halves(both: &Matrix) -> [Matrix; 2] {
    let (rows, n) = (both.rows(), both.cols() / 2);
    [0, n].map(|start| {
        let half = both.values().chunks_exact(2 * n).flat_map(|row| &row[start..start + n]);
        Matrix::new(rows, n, half.copied().collect())
    })
}
