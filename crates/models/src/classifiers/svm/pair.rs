//! The two-class machines that vote, and the rows that they share.

use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::probability::Sigmoid;

/// One two-class machine: class `first` is on the positive side.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Pair {
    pub first: usize,
    pub second: usize,
    /// rows of the support table
    pub rows: Vec<u32>,
    /// α·y of each
    pub coefficients: Vec<f64>,
    pub rho: f64,
    pub sigmoid: Option<Sigmoid>,
}

impl Pair {
    /// Rows and α·y of each.
    pub fn terms(&self) -> impl Iterator<Item = (usize, &f64)> {
        self.rows.iter().map(|&row| row as usize).zip(&self.coefficients)
    }
}

/// Keeps each training row that any pair needs once, and renumbers the pairs' rows.
pub(super) fn compact(pairs: &mut [Pair], x: ArrayView2<'_, f64>) -> Array2<f64> {
    let mut used: Vec<u32> = pairs.iter().flat_map(|p| p.rows.iter().copied()).collect();
    used.sort_unstable();
    used.dedup();
    let mut number = vec![0; x.nrows()];
    used.iter().enumerate().for_each(|(i, &row)| number[row as usize] = i as u32);
    pairs.iter_mut().for_each(|p| p.rows.iter_mut().for_each(|r| *r = number[*r as usize]));
    let rows: Vec<usize> = used.iter().map(|&r| r as usize).collect();
    x.select(Axis(0), &rows)
}
