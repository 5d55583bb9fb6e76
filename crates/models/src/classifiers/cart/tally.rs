//! Class weights on both sides of a threshold, and the impurity they mean.

use super::Criterion;

/// Class weights on both sides of a moving threshold.
pub(super) struct Tally<'a> {
    criterion: Criterion,
    /// weight of each class at or below the threshold
    pub left: &'a mut Vec<f64>,
    right: &'a mut Vec<f64>,
    left_sum: f64,
    right_sum: f64,
    /// Σ of squares on either side, kept up to date for gini
    left_squares: f64,
    right_squares: f64,
}

impl<'a> Tally<'a> {
    /// Everything on the right.
    pub(super) fn new(
        criterion: Criterion,
        totals: &[f64],
        left: &'a mut Vec<f64>,
        right: &'a mut Vec<f64>,
    ) -> Self {
        left.clear();
        left.resize(totals.len(), 0.0);
        right.clear();
        right.extend_from_slice(totals);
        Self {
            criterion,
            left,
            right,
            left_sum: 0.0,
            right_sum: totals.iter().sum(),
            left_squares: 0.0,
            right_squares: totals.iter().map(|t| t * t).sum(),
        }
    }

    /// Sums anew from the left side.
    pub(super) fn recount(&mut self, totals: &[f64]) {
        for ((right, left), total) in self.right.iter_mut().zip(self.left.iter()).zip(totals) {
            *right = total - left;
        }
        self.left_sum = self.left.iter().sum();
        self.right_sum = self.right.iter().sum();
        self.left_squares = self.left.iter().map(|t| t * t).sum();
        self.right_squares = self.right.iter().map(|t| t * t).sum();
    }

    /// One row goes from right to left.
    pub(super) fn shift(&mut self, class: usize, weight: f64) {
        let (left, right) = (&mut self.left[class], &mut self.right[class]);
        self.left_squares += weight * (2.0 * *left + weight);
        self.right_squares -= weight * (2.0 * *right - weight);
        *left += weight;
        *right -= weight;
        self.left_sum += weight;
        self.right_sum -= weight;
    }

    /// Larger is purer: minus the weighted impurity of both sides, up to a constant of the node.
    pub(super) fn gain(&self) -> f64 {
        match self.criterion {
            Criterion::Gini => {
                self.left_squares / self.left_sum + self.right_squares / self.right_sum
            }
            Criterion::Entropy => {
                minus_entropy(self.left, self.left_sum) + minus_entropy(self.right, self.right_sum)
            }
        }
    }
}

/// The gain of a side that holds these class weights, by itself.
pub(super) fn purity(criterion: Criterion, totals: &[f64]) -> f64 {
    let sum: f64 = totals.iter().sum();
    match criterion {
        Criterion::Gini => totals.iter().map(|t| t * t).sum::<f64>() / sum,
        Criterion::Entropy => minus_entropy(totals, sum),
    }
}

/// Σ c log(c / sum)
fn minus_entropy(counts: &[f64], sum: f64) -> f64 {
    counts.iter().filter(|&&c| c > 0.0).map(|c| c * (c / sum).ln()).sum()
}
