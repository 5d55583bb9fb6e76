//! Rows of the arrays of other programs, named by an array of ids beside them.

use std::collections::HashSet;

use corsmal_files::npy::Kind;
use corsmal_files::npz::NpzFile;
use corsmal_files::table::ID_NAMES;
use ndarray::{ArrayD, Axis};

/// Ids of rows in an archive of another program: an array called `id` or `ids` with another value in every row, as
/// `train` has it.
pub(super) fn ids(npz: &mut NpzFile) -> Option<Vec<String>> {
    ID_NAMES.into_iter().find_map(|name| {
        let header = npz.contains(name).then(|| npz.header(name).ok()).flatten()?;
        let ids = match (header.shape.len(), header.dtype.kind) {
            (1, Kind::Text | Kind::Bytes) => npz.strings(name).ok()?,
            (1, Kind::Int | Kind::UInt) => {
                npz.integers(name).ok()?.iter().map(i128::to_string).collect()
            }
            _ => return None,
        };
        let mut seen = HashSet::new();
        let is_id = |id: &String| !id.is_empty() && seen.insert(id.clone());
        (!ids.is_empty() && ids.iter().all(is_id)).then_some(ids)
    })
}

/// Rows of two files that belong together although their numbers differ.
#[derive(Debug)]
pub(super) struct RowPairs {
    /// Rows in the first and in the second file.
    pub pairs: Vec<(usize, usize)>,
    /// How many rows there are in each.
    pub of: (usize, usize),
}

impl RowPairs {
    /// The rows that belong together of arrays that have a row for each id of their files. The rows of arrays of
    /// `complex` numbers are after a first axis of real and imaginary parts.
    pub(super) fn taken<T: Clone>(
        &self,
        (x, y): &(ArrayD<T>, ArrayD<T>),
        complex: [bool; 2],
    ) -> Option<(ArrayD<T>, ArrayD<T>)> {
        let [of_x, of_y] = complex.map(usize::from);
        let fit =
            x.shape().get(of_x) == Some(&self.of.0) && y.shape().get(of_y) == Some(&self.of.1);
        let (in_x, in_y): (Vec<usize>, Vec<usize>) = self.pairs.iter().copied().unzip();
        fit.then(|| (x.select(Axis(of_x), &in_x), y.select(Axis(of_y), &in_y)))
    }
}
