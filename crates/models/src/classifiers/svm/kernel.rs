//! Kernel values: all at once when they fit the memory allowed, else row by row through a cache.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, CowArray, Ix2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result};

/// The kernel with its width settled.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) enum Function {
    Rbf { gamma: f64 },
    Linear,
}

/// Rows less their mean, if they are far from zero compared with how much they differ: products of the
/// rows themselves have no digits left for the differences then. Else the rows, less zero.
pub(super) struct Centred<'a> {
    pub(super) x: CowArray<'a, f64, Ix2>,
    /// `None`: zero
    pub(super) centre: Option<Array1<f64>>,
}

/// The squared mean in variances from which rows are far. Single precision, in which kernel values are
/// kept, has three digits left for the differences, as many as a solver's tolerance.
const FAR: f64 = 1e4;

impl<'a> Centred<'a> {
    pub(super) fn new(x: ArrayView2<'a, f64>) -> Self {
        let rows = x.nrows().max(1) as f64;
        // From the first row on, so that a constant has no remainder.
        let first = x.outer_iter().next().map(|row| row.to_owned()).unwrap_or_default();
        let mut beyond = Array1::<f64>::zeros(first.len());
        x.outer_iter().for_each(|row| beyond += &(&row - &first));
        let centre = first + beyond / rows;
        let square = |row: ArrayView1<'_, f64>| -> f64 {
            row.iter().zip(&centre).map(|(v, c)| (v - c) * (v - c)).sum()
        };
        let variance = x.outer_iter().map(square).sum::<f64>() / rows;
        if centre.dot(&centre) > FAR * variance {
            Self { x: (&x.as_standard_layout() - &centre).into(), centre: Some(centre) }
        } else {
            Self { x: standard(x), centre: None }
        }
    }

    /// Other rows less the same.
    pub(super) fn shifted<'b>(&self, x: ArrayView2<'b, f64>) -> CowArray<'b, f64, Ix2> {
        match &self.centre {
            Some(centre) => (&x - centre).into(),
            None => x.into(),
        }
    }
}

fn standard(x: ArrayView2<'_, f64>) -> CowArray<'_, f64, Ix2> {
    if x.is_standard_layout() { x.into() } else { x.as_standard_layout().into_owned().into() }
}

impl Function {
    /// What Σαy·K(row, ·) of rows as they are exceeds that of the rows centred by; `terms` are rows
    /// and αy, whose sum is zero.
    pub(super) fn shift<'a>(
        self,
        rows: &Centred<'_>,
        terms: impl Iterator<Item = (usize, &'a f64)>,
    ) -> f64 {
        match self {
            Self::Rbf { .. } => 0.0,
            Self::Linear => rows
                .centre
                .as_ref()
                .map_or(0.0, |centre| terms.map(|(row, c)| c * rows.x.row(row).dot(centre)).sum()),
        }
    }

    fn finish(self, dot: f64, norm_a: f64, norm_b: f64) -> f64 {
        match self {
            Self::Linear => dot,
            Self::Rbf { gamma } => (-gamma * (norm_a + norm_b - 2.0 * dot)).exp(),
        }
    }

    pub(super) fn is_valid(self) -> bool {
        match self {
            Self::Linear => true,
            Self::Rbf { gamma } => gamma.is_finite() && gamma > 0.0,
        }
    }

    /// Kernel of every row of `a` with every row of `b` (whose squared lengths are given).
    pub(super) fn matrix(
        self,
        a: ArrayView2<'_, f64>,
        b: ArrayView2<'_, f64>,
        b_norms: &[f64],
    ) -> Array2<f64> {
        let mut values = a.dot(&b.t());
        for (mut row, norm) in values.outer_iter_mut().zip(squared_lengths(a)) {
            row.iter_mut().zip(b_norms).for_each(|(v, bn)| *v = self.finish(*v, norm, *bn));
        }
        values
    }
}

pub(super) fn squared_lengths(x: ArrayView2<'_, f64>) -> Vec<f64> {
    x.outer_iter().map(|row| row.dot(&row)).collect()
}

/// What kernel values are kept in.
pub(super) trait Precision: Copy + Default + Into<f64> + Send {
    const IS_ROUNDED: bool;

    fn of(value: f64) -> Self;

    /// All values of a table, where they are kept so.
    fn all<'g>(gram: &'g Gram<'_>) -> Option<&'g Array2<Self>>;
}

impl Precision for f32 {
    const IS_ROUNDED: bool = true;

    fn of(value: f64) -> Self {
        value as f32
    }

    fn all<'g>(gram: &'g Gram<'_>) -> Option<&'g Array2<Self>> {
        gram.full.as_ref()
    }
}

impl Precision for f64 {
    const IS_ROUNDED: bool = false;

    fn of(value: f64) -> Self {
        value
    }

    fn all<'g>(_: &'g Gram<'_>) -> Option<&'g Array2<Self>> {
        None
    }
}

/// Kernel values among the training rows.
pub(super) struct Gram<'a> {
    x: ArrayView2<'a, f64>,
    norms: Vec<f64>,
    function: Function,
    /// all of them in single precision, if they fit
    full: Option<Array2<f32>>,
}

/// Multiplications above which one row of kernel values is shared among threads.
const PARALLEL_WORK: usize = 400_000;

impl<'a> Gram<'a> {
    /// `x` in standard layout.
    pub(super) fn new(x: ArrayView2<'a, f64>, function: Function, budget: usize) -> Result<Self> {
        let norms = squared_lengths(x);
        let gram = Self { x, norms, function, full: None };
        // Kernel values are kept in single precision: they must be finite there.
        let most = if matches!(function, Function::Linear) { 1e37 } else { f64::MAX };
        if !gram.norms.iter().all(|&norm| norm <= most) {
            return Err(ModelError::Numerical {
                owner: "svm",
                reason: "features are too large: standardise them first".into(),
            });
        }
        let bytes = x.nrows().checked_mul(x.nrows()).and_then(|n| n.checked_mul(size_of::<f32>()));
        let full = bytes.is_some_and(|b| b <= budget).then(|| gram.all());
        Ok(Self { full, ..gram })
    }

    fn all(&self) -> Array2<f32> {
        const BLOCK: usize = 128;
        let n = self.x.nrows();
        let mut all = Array2::zeros((n, n));
        all.axis_chunks_iter_mut(Axis(0), BLOCK)
            .into_par_iter()
            .zip(self.x.axis_chunks_iter(Axis(0), BLOCK))
            .for_each(|(mut out, block)| {
                let values = self.function.matrix(block, self.x, &self.norms);
                out.zip_mut_with(&values, |to, &from| *to = from as f32);
            });
        all
    }

    /// Kernel of training row `row` with each of `others`.
    pub(super) fn fill<T: Precision>(&self, row: u32, others: &[u32], out: &mut [T]) {
        let i = row as usize;
        if let Some(full) = T::all(self) {
            let values = full.row(i);
            let values = values.to_slice().expect("standard layout");
            out.iter_mut().zip(others).for_each(|(to, &j)| *to = values[j as usize]);
            return;
        }
        let a = self.x.row(i);
        let value = |j: u32| {
            let j = j as usize;
            T::of(self.function.finish(a.dot(&self.x.row(j)), self.norms[i], self.norms[j]))
        };
        if others.len() * self.x.ncols() < PARALLEL_WORK {
            out.iter_mut().zip(others).for_each(|(to, &j)| *to = value(j));
        } else {
            out.par_iter_mut().with_min_len(256).zip(others).for_each(|(to, &j)| *to = value(j));
        }
    }

    /// K(row, row).
    pub(super) fn diagonal(&self, row: u32) -> f64 {
        let norm = self.norms[row as usize];
        self.function.finish(norm, norm, norm)
    }

    /// The kernel matrix of some rows, for a solver.
    pub(super) fn rows<'b, T: Precision>(
        &'b self,
        rows: &'b [u32],
        cache_bytes: usize,
    ) -> Rows<'b, 'a, T> {
        let per_row = size_of::<T>() * rows.len().max(1);
        Rows {
            gram: self,
            rows,
            // The solver holds two rows at a time.
            capacity: (cache_bytes / per_row).clamp(2, rows.len().max(2)),
            slots: Vec::new(),
            slot_of: vec![u32::MAX; rows.len()],
            clock: 0,
        }
    }
}

struct Slot<T> {
    row: usize,
    used: u64,
    values: Vec<T>,
}

/// Rows of a kernel matrix with the least recently used ones forgotten when memory is used up.
pub(super) struct Rows<'a, 'x, T> {
    gram: &'a Gram<'x>,
    rows: &'a [u32],
    capacity: usize,
    slots: Vec<Slot<T>>,
    slot_of: Vec<u32>,
    clock: u64,
}

impl<T: Precision> Rows<'_, '_, T> {
    /// Row `i`.
    pub(super) fn one(&mut self, i: usize) -> &[T] {
        let slot = self.load(i);
        &self.slots[slot].values
    }

    /// Rows `i` and `j`.
    pub(super) fn two(&mut self, i: usize, j: usize) -> (&[T], &[T]) {
        // The first is now the most recently used: loading the second leaves it in place.
        let first = self.load(i);
        let second = self.load(j);
        (&self.slots[first].values, &self.slots[second].values)
    }

    fn load(&mut self, i: usize) -> usize {
        self.clock += 1;
        let slot = self.slot_of[i] as usize;
        if slot < self.slots.len() {
            self.slots[slot].used = self.clock;
            return slot;
        }
        let slot = if self.slots.len() < self.capacity {
            self.slots.push(Slot { row: i, used: 0, values: vec![T::default(); self.rows.len()] });
            self.slots.len() - 1
        } else {
            let oldest = self.slots.iter().enumerate().min_by_key(|(_, s)| s.used);
            let slot = oldest.map_or(0, |(at, _)| at);
            self.slot_of[self.slots[slot].row] = u32::MAX;
            slot
        };
        self.slot_of[i] = slot as u32;
        let entry = &mut self.slots[slot];
        entry.row = i;
        entry.used = self.clock;
        self.gram.fill(self.rows[i], self.rows, &mut entry.values);
        slot
    }
}
