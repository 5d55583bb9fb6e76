//! Weights in the order in which products read them, packed once for all calls.
//!
//! A product keeps a block of outputs in registers: a few rows times a panel of two vectors of outputs. Every output
//! is a sum over its weights in their order, so results depend neither on threads nor on the other rows.

use pulp::{Arch, NullaryFnOnce, Simd, WithSimd};
use rayon::prelude::*;

use crate::matrix::Matrix;

/// Vectors of outputs in a panel.
const VECTORS: usize = 2;
/// Rows of a block: with two vectors each, their sums are twelve of sixteen registers.
const ROWS: usize = 6;
/// Rows of a block where there are thirty-two registers.
const MORE_ROWS: usize = 2 * ROWS;
/// Panels of a block of one row, so that as many sums run side by side.
const PANELS: usize = 4;
/// Numbers that are summed before their sum goes to the others, about: rounding grows with the length of a sum, and
/// the weights of a part stay in the nearest cache while all rows pass.
const PART: usize = 256;
/// Rows that a thread multiplies at a time: what they see stays in the cache while the panels pass.
const TOGETHER: usize = 32 * ROWS;

/// Weights `[outputs, inputs]`.
#[derive(Debug)]
pub(crate) struct Packed {
    inputs: usize,
    outputs: usize,
    /// outputs of a panel
    width: usize,
    /// `[panels][inputs][width]`, zeros beyond the last output
    panels: Vec<f32>,
}

/// What rows of a product see: each several runs of numbers, as many as the weights have inputs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Runs<'a> {
    pub(crate) values: &'a [f32],
    /// where the first run of each row begins
    pub(crate) starts: &'a [usize],
    /// runs of a row
    pub(crate) count: usize,
    /// from the beginning of a run to that of the next
    pub(crate) jump: usize,
    /// numbers of a run
    pub(crate) length: usize,
}

/// What is summed before the sum goes to the others: some runs, or a piece of one.
#[derive(Clone, Copy, Debug)]
struct Part {
    runs: (usize, usize),
    /// place in each run
    first: usize,
    length: usize,
}

impl Part {
    fn begins(self) -> bool {
        self.runs.0 == 0 && self.first == 0
    }
}

impl Runs<'_> {
    /// All numbers of a row, part by part.
    fn parts(self) -> impl Iterator<Item = Part> + Clone + use<> {
        let Self { count, length, .. } = self;
        let pieces = length.div_ceil(PART).max(1);
        let piece = length.div_ceil(pieces).max(1);
        let together = if pieces > 1 { 1 } else { PART.div_ceil(piece) };
        (0..count.max(1)).step_by(together).flat_map(move |run| {
            (0..length.max(1)).step_by(piece).map(move |first| Part {
                runs: (run, count.min(run + together)),
                first,
                length: piece.min(length - first),
            })
        })
    }
}

impl Packed {
    pub(crate) fn new(weight: &Matrix) -> Self {
        let (outputs, inputs) = (weight.rows(), weight.cols());
        let width = Arch::new().dispatch(Width);
        let mut panels = vec![0.0; outputs.div_ceil(width) * width * inputs];
        let rows = weight.values().par_chunks((width * inputs).max(1));
        panels.par_chunks_mut((width * inputs).max(1)).zip(rows).for_each(|(panel, rows)| {
            for (o, row) in rows.chunks_exact(inputs).enumerate() {
                panel[o..].iter_mut().step_by(width).zip(row).for_each(|(to, w)| *to = *w);
            }
        });
        Self { inputs, outputs, width, panels }
    }

    /// The product of rows of `inputs` numbers with `weight^T`, plus `bias` in every row.
    pub(crate) fn product(&self, values: &[f32], bias: Option<&[f32]>) -> Matrix {
        let rows = values.len() / self.inputs.max(1);
        let mut out = Matrix::zeros(rows, self.outputs);
        self.product_into(values, bias, out.values_mut());
        out
    }

    /// The same into `out`, whose numbers are replaced.
    pub(crate) fn product_into(&self, values: &[f32], bias: Option<&[f32]>, out: &mut [f32]) {
        let rows = values.len() / self.inputs.max(1);
        let share = rows.div_ceil(rayon::current_num_threads()).next_multiple_of(ROWS);
        let together = share.clamp(ROWS, TOGETHER);
        let pieces = out.par_chunks_mut((together * self.outputs).max(1)).enumerate();
        pieces.for_each(|(piece, out)| {
            let first = piece * together;
            let rows = first..rows.min(first + together);
            let starts: Vec<usize> = rows.map(|row| row * self.inputs).collect();
            let runs = Runs { values, starts: &starts, count: 1, jump: 0, length: self.inputs };
            self.multiply(runs, bias, out);
        });
    }

    /// The same into `out` for rows that lie anywhere, on this thread.
    ///
    /// # Panics
    /// When rows have other numbers than the weights, or leave the values.
    pub(crate) fn multiply(&self, runs: Runs<'_>, bias: Option<&[f32]>, out: &mut [f32]) {
        assert_eq!(runs.count * runs.length, self.inputs, "numbers of a row");
        assert_eq!(out.len(), runs.starts.len() * self.outputs, "numbers of the product");
        assert!(bias.is_none_or(|bias| bias.len() == self.outputs), "a bias for each output");
        Arch::new().dispatch(Product { packed: self, runs, bias, out });
    }
}

struct Width;

impl WithSimd for Width {
    type Output = usize;

    fn with_simd<S: Simd>(self, _: S) -> usize {
        VECTORS * S::F32_LANES
    }
}

struct Product<'a> {
    packed: &'a Packed,
    runs: Runs<'a>,
    bias: Option<&'a [f32]>,
    out: &'a mut [f32],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let panels = self.packed.outputs.div_ceil(self.packed.width);
        if self.runs.starts.len() == 1 {
            let (blocks, rest) = (panels / PANELS, panels % PANELS);
            let parts = self.runs.parts();
            for b in 0..blocks {
                self.block::<S, 1, PANELS>(simd, 0, b * PANELS, parts.clone());
            }
            (panels - rest..panels).for_each(|p| self.block::<S, 1, 1>(simd, 0, p, parts.clone()));
            return;
        }
        for panel in 0..panels {
            match self.runs.count {
                // Long rows: the weights of a part stay in the nearest cache while all rows pass.
                1 => {
                    let parts = self.runs.parts();
                    parts.for_each(|part| self.rows(simd, panel, std::iter::once(part)));
                }
                _ => self.rows(simd, panel, self.runs.parts()),
            }
        }
    }
}

impl Product<'_> {
    /// Parts of all rows for a panel.
    #[inline(always)]
    fn rows<S: Simd>(&mut self, simd: S, panel: usize, parts: impl Iterator<Item = Part> + Clone) {
        let rows = self.runs.starts.len();
        let (mut begun, whole) = (0, rows / ROWS * ROWS);
        if S::REGISTER_COUNT >= 32 {
            while begun + MORE_ROWS <= rows {
                self.block::<S, MORE_ROWS, 1>(simd, begun, panel, parts.clone());
                begun += MORE_ROWS;
            }
        }
        for row in (begun..whole).step_by(ROWS) {
            self.block::<S, ROWS, 1>(simd, row, panel, parts.clone());
        }
        match rows - whole {
            5 => self.block::<S, 5, 1>(simd, whole, panel, parts),
            4 => self.block::<S, 4, 1>(simd, whole, panel, parts),
            3 => self.block::<S, 3, 1>(simd, whole, panel, parts),
            2 => self.block::<S, 2, 1>(simd, whole, panel, parts),
            1 => self.block::<S, 1, 1>(simd, whole, panel, parts),
            _ => (),
        }
    }

    #[inline(always)]
    fn block<S: Simd, const R: usize, const P: usize>(
        &mut self,
        simd: S,
        row: usize,
        panel: usize,
        parts: impl Iterator<Item = Part>,
    ) {
        let Self { packed, runs, bias, out } = self;
        let (runs, bias) = (*runs, *bias);
        simd.vectorize(Block::<S, _, R, P> { simd, packed, runs, parts, bias, row, panel, out });
    }
}

/// `R` rows times `P` panels, over parts of their numbers.
struct Block<'a, S: Simd, I, const R: usize, const P: usize> {
    simd: S,
    packed: &'a Packed,
    runs: Runs<'a>,
    parts: I,
    bias: Option<&'a [f32]>,
    row: usize,
    panel: usize,
    out: &'a mut [f32],
}

impl<S: Simd, I: Iterator<Item = Part>, const R: usize, const P: usize> NullaryFnOnce
    for Block<'_, S, I, R, P>
{
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { simd, packed, runs, parts, bias, row, panel, out } = self;
        let each = packed.width * packed.inputs;
        let weights: [_; P] = std::array::from_fn(|p| {
            let panel = &packed.panels[(panel + p) * each..][..each];
            S::as_simd_f32s(panel).0.as_chunks::<VECTORS>().0
        });
        let starts = &runs.starts[row..row + R];
        let mut to = Output { packed, bias, row, panel, out };
        for part in parts {
            let mut sums = [[[simd.splat_f32s(0.0); VECTORS]; P]; R];
            for run in part.runs.0..part.runs.1 {
                let at = run * runs.jump + part.first;
                let x: [_; R] =
                    std::array::from_fn(|r| &runs.values[starts[r] + at..][..part.length]);
                let at = run * runs.length + part.first;
                let w: [_; P] = std::array::from_fn(|p| &weights[p][at..][..part.length]);
                sums = multiplied(simd, x, w, sums);
            }
            to.add(simd, &sums, part.begins());
        }
    }
}

/// The sums of a block and of some more numbers. They are passed by value to stay in registers.
#[inline(always)]
fn multiplied<S: Simd, const R: usize, const P: usize>(
    simd: S,
    x: [&[f32]; R],
    w: [&[[S::f32s; VECTORS]]; P],
    mut sums: [[[S::f32s; VECTORS]; P]; R],
) -> [[[S::f32s; VECTORS]; P]; R] {
    // Slices of one length, so that the loop needs no checks.
    let length = x.first().map_or(0, |x| x.len());
    let x: [&[f32]; R] = std::array::from_fn(|r| &x[r][..length]);
    let w: [&[[S::f32s; VECTORS]]; P] = std::array::from_fn(|p| &w[p][..length]);
    for k in 0..length {
        let w: [[S::f32s; VECTORS]; P] = std::array::from_fn(|p| w[p][k]);
        for (x, sums) in x.iter().zip(&mut sums) {
            let x = simd.splat_f32s(x[k]);
            for (w, sum) in w.as_flattened().iter().zip(sums.as_flattened_mut()) {
                *sum = simd.mul_add_e_f32s(x, *w, *sum);
            }
        }
    }
    sums
}

/// Where the sums of a block go.
struct Output<'a> {
    packed: &'a Packed,
    bias: Option<&'a [f32]>,
    row: usize,
    panel: usize,
    out: &'a mut [f32],
}

impl Output<'_> {
    #[inline(always)]
    /// `begins`: whether nothing is there yet.
    fn add<S: Simd, const R: usize, const P: usize>(
        &mut self,
        simd: S,
        sums: &[[[S::f32s; VECTORS]; P]; R],
        begins: bool,
    ) {
        let Packed { outputs, width, .. } = *self.packed;
        for (r, sums) in sums.iter().enumerate() {
            for (p, sums) in sums.iter().enumerate() {
                let first = (self.panel + p) * width;
                let end = outputs.min(first + width);
                let row = (self.row + r) * outputs;
                let to = &mut self.out[row + first..row + end];
                let bias = self.bias.filter(|_| begins).map(|bias| &bias[first..end]);
                if to.len() == width {
                    let to = S::as_mut_simd_f32s(to).0;
                    let bias = bias.map(|bias| S::as_simd_f32s(bias).0);
                    for (v, (to, sum)) in to.iter_mut().zip(sums).enumerate() {
                        *to = match bias {
                            Some(bias) => simd.add_f32s(bias[v], *sum),
                            None if begins => *sum,
                            None => simd.add_f32s(*to, *sum),
                        };
                    }
                    continue;
                }
                for (v, (to, sum)) in to.chunks_mut(S::F32_LANES).zip(sums).enumerate() {
                    let first = v * S::F32_LANES;
                    let before = match bias {
                        Some(bias) => simd.partial_load_f32s(&bias[first..first + to.len()]),
                        None if begins => simd.splat_f32s(0.0),
                        None => simd.partial_load_f32s(to),
                    };
                    simd.partial_store_f32s(to, simd.add_f32s(before, *sum));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
