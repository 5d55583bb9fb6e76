//! Sequences step after step, without their padding.

use std::ops::Range;

use crate::matrix::Matrix;

/// Where each step of each sequence lies.
#[derive(Debug)]
pub(super) struct Packing {
    /// items, longest first; equal ones in their order
    order: Vec<usize>,
    /// row of the first item of each step, and the end
    starts: Vec<usize>,
    /// steps of the padded batch
    padded: usize,
}

impl Packing {
    /// Without lengths every item has all steps; none has fewer than one.
    pub(super) fn new(items: usize, padded: usize, lengths: Option<&[usize]>) -> Self {
        let length = |i: usize| lengths.map_or(padded, |l| l[i].clamp(1, padded));
        let mut order: Vec<usize> = (0..items).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(length(i)));
        let longest = order.first().map_or(0, |&i| length(i));
        let mut starts = vec![0];
        let mut active = items;
        for step in 0..longest {
            while active > 0 && length(order[active - 1]) <= step {
                active -= 1;
            }
            starts.push(starts[step] + active);
        }
        Self { order, starts, padded }
    }

    pub(super) fn items(&self) -> usize {
        self.order.len()
    }

    pub(super) fn steps(&self) -> usize {
        self.starts.len() - 1
    }

    /// Rows of a step.
    pub(super) fn rows(&self, step: usize) -> Range<usize> {
        self.starts[step]..self.starts[step + 1]
    }

    /// All steps, as many at a time as have `most` rows together, or one.
    pub(super) fn stretches(&self, most: usize) -> impl Iterator<Item = Range<usize>> {
        let mut begun = 0;
        std::iter::from_fn(move || {
            let first = *self.starts.get(begun)?;
            let fits = self.starts[begun..].partition_point(|start| start - first <= most);
            let steps = begun..(begun + fits - 1).max(begun + 1);
            begun = steps.end;
            (steps.end < self.starts.len()).then_some(steps)
        })
    }

    pub(super) fn total(&self) -> usize {
        self.starts[self.steps()]
    }

    /// `[items * padded, n]` to packed rows.
    pub(super) fn pack(&self, values: &[f32], n: usize) -> Matrix {
        self.pack_steps(0..self.steps(), values, n)
    }

    /// The packed rows of these steps.
    pub(super) fn pack_steps(&self, steps: Range<usize>, values: &[f32], n: usize) -> Matrix {
        let rows = self.starts[steps.end] - self.starts[steps.start];
        let mut out = Vec::with_capacity(rows * n);
        for step in steps {
            for &item in &self.order[..self.rows(step).len()] {
                let at = (item * self.padded + step) * n;
                out.extend_from_slice(&values[at..at + n]);
            }
        }
        Matrix::new(rows, n, out)
    }

    /// Packed rows to `[items * padded, n]`, zeros where there is nothing.
    pub(super) fn unpack(&self, values: &[f32], n: usize) -> Matrix {
        let mut out = Matrix::zeros(self.items() * self.padded, n);
        let all = out.values_mut();
        for step in 0..self.steps() {
            let rows = self.rows(step);
            for (row, &item) in rows.clone().zip(&self.order) {
                let at = (item * self.padded + step) * n;
                all[at..at + n].copy_from_slice(&values[row * n..(row + 1) * n]);
            }
        }
        out
    }

    /// The last step of every sequence, in the order of the items: `[items, n]`.
    pub(super) fn last(&self, values: &[f32], n: usize) -> Matrix {
        let mut out = Matrix::zeros(self.items(), n);
        self.last_of_steps(0..self.steps(), values, n, &mut out);
        out
    }

    /// Of packed rows of these steps, those that are the last of their sequences, to the rows of their items.
    pub(super) fn last_of_steps(
        &self,
        steps: Range<usize>,
        values: &[f32],
        n: usize,
        out: &mut Matrix,
    ) {
        let (all, first) = (out.values_mut(), self.starts[steps.start]);
        self.ends(steps, |row, item| {
            let row = row - first;
            all[item * n..(item + 1) * n].copy_from_slice(&values[row * n..(row + 1) * n]);
        });
    }

    /// Packed rows that are zero but for the last step of every sequence.
    pub(super) fn only_last(&self, values: &[f32], n: usize) -> Matrix {
        let mut out = Matrix::zeros(self.total(), n);
        let all = out.values_mut();
        self.ends(0..self.steps(), |row, item| {
            all[row * n..(row + 1) * n].copy_from_slice(&values[item * n..(item + 1) * n]);
        });
        out
    }

    /// Packed rows with every sequence in reverse.
    pub(super) fn reversed(&self, rows: &Matrix) -> Matrix {
        let n = rows.cols();
        let mut lengths = vec![0; self.items()];
        for step in 0..self.steps() {
            lengths[..self.rows(step).len()].iter_mut().for_each(|length| *length += 1);
        }
        let mut out = Vec::with_capacity(rows.values().len());
        for step in 0..self.steps() {
            for (place, length) in lengths[..self.rows(step).len()].iter().enumerate() {
                let from = self.starts[length - 1 - step] + place;
                out.extend_from_slice(&rows.values()[from * n..(from + 1) * n]);
            }
        }
        Matrix::new(rows.rows(), n, out)
    }

    /// For each item that ends in these steps, the row of its last step.
    fn ends(&self, steps: Range<usize>, mut each: impl FnMut(usize, usize)) {
        for step in steps {
            let rows = self.rows(step);
            let go_on = if step + 1 < self.steps() { self.rows(step + 1).len() } else { 0 };
            (go_on..rows.len()).for_each(|place| each(rows.start + place, self.order[place]));
        }
    }

    /// For each row after the first step, the row of the step before; none where all sequences
    /// have one step.
    pub(super) fn states_before(&self, hidden: &[f32], n: usize) -> Option<Matrix> {
        let first = self.rows(0).len();
        if self.total() == first {
            return None;
        }
        let mut out = Vec::with_capacity((self.total() - first) * n);
        for step in 1..self.steps() {
            let before = self.rows(step - 1).start;
            out.extend_from_slice(&hidden[before * n..(before + self.rows(step).len()) * n]);
        }
        Some(Matrix::new(self.total() - first, n, out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packing_and_unpacking_give_back_all_but_the_padding() {
        let packing = Packing::new(3, 4, Some(&[2, 4, 1]));
        assert_eq!((packing.steps(), packing.total()), (4, 7));
        let values: Vec<f32> = (0..12).map(|i| i as f32).collect();
        let packed = packing.pack(&values, 1);
        assert_eq!(packed.values(), [4.0, 0.0, 8.0, 5.0, 1.0, 6.0, 7.0]);
        let expected = [0.0, 1.0, 0.0, 0.0, 4.0, 5.0, 6.0, 7.0, 8.0, 0.0, 0.0, 0.0];
        assert_eq!(packing.unpack(packed.values(), 1).values(), expected);
        assert_eq!(packing.last(packed.values(), 1).values(), [1.0, 7.0, 8.0]);
        let ends = packing.only_last(&[1.0, 2.0, 3.0], 1);
        assert_eq!(ends.values(), [0.0, 0.0, 3.0, 0.0, 1.0, 0.0, 2.0]);
        // Items 1 (4 to 7), 0 (0, 1), 2 (8).
        let reversed = packing.reversed(&packed);
        assert_eq!(reversed.values(), [7.0, 1.0, 8.0, 6.0, 0.0, 5.0, 4.0]);
        assert_eq!(packing.reversed(&reversed).values(), packed.values());
        let before = packing.states_before(packed.values(), 1).unwrap();
        assert_eq!(before.values(), [4.0, 0.0, 5.0, 6.0]);
        let of = |most| packing.stretches(most).collect::<Vec<_>>();
        assert!(matches!(&of(100)[..], [all] if *all == (0..4)));
        assert_eq!(of(1), [0..1, 1..2, 2..3, 3..4]);
        assert_eq!(of(3), [0..1, 1..3, 3..4]);
        assert!(Packing::new(0, 4, None).stretches(9).next().is_none());
        let short = Packing::new(2, 1, None);
        assert!(short.states_before(&[1.0, 2.0], 1).is_none());
    }
}
