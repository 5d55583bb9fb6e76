//! The rows that a tree grows on.

/// The labels and weights a tree grows on.
pub(in crate::classifiers) struct Sample<'a> {
    pub y: &'a [u32],
    /// how often each row counts; rows that count zero times are left out
    pub times: &'a [u32],
    /// how much a row of each class counts
    pub class_weights: &'a [f64],
    /// how much each row counts, beside its class
    pub row_weights: Option<&'a [f64]>,
}

impl Sample<'_> {
    pub(super) fn weight(&self, row: usize) -> f64 {
        let weight = f64::from(self.times[row]) * self.class_weights[self.y[row] as usize];
        self.row_weights.map_or(weight, |of| weight * of[row])
    }
}
