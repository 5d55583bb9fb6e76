//! How well probabilities say how often a prediction is right.

use ndarray::ArrayView1;
use serde::Serialize;

use crate::table::argmax;

/// Bins of the highest probability, of equal width.
const BINS: usize = 15;

/// Scores of probabilities.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reliability {
    /// mean squared distance of the probabilities from the truth, 0 to 2; with two classes half of
    /// it, 0 to 1 (scikit-learn's `brier_score_loss` with `scale_by_half="auto"`)
    pub brier: f64,
    /// expected calibration error: the mean difference, over rows, between the highest probability
    /// and the share of right predictions in its bin (15 bins of equal width)
    pub ece: f64,
    /// the bins that hold rows
    pub bins: Vec<ReliabilityBin>,
}

/// Rows whose highest probability is in one interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReliabilityBin {
    /// rows
    pub rows: usize,
    /// mean of their highest probabilities
    pub confidence: f64,
    /// share of them whose most probable class is right
    pub accuracy: f64,
}

impl Reliability {
    /// Of the rows' true classes, of which there are `classes`, and their probabilities, one for each
    /// class that the model knows: those of the others are 0.
    pub(super) fn new<'a>(rows: &[(usize, ArrayView1<'a, f64>)], classes: usize) -> Self {
        let n = rows.len().max(1) as f64;
        let mut brier = 0.0;
        let mut bins = [(0usize, 0.0, 0usize); BINS];
        for (truth, proba) in rows {
            brier += proba
                .iter()
                .enumerate()
                .map(|(class, p)| (p - f64::from(u8::from(class == *truth))).powi(2))
                .sum::<f64>();
            brier += f64::from(u8::from(*truth >= proba.len()));
            let best = argmax(proba.iter());
            let highest = proba[best];
            let bin = ((highest * BINS as f64).ceil() as usize).clamp(1, BINS) - 1;
            bins[bin].0 += 1;
            bins[bin].1 += highest;
            bins[bin].2 += usize::from(best == *truth);
        }
        let filled = bins.into_iter().filter(|bin| bin.0 > 0);
        let bins: Vec<ReliabilityBin> = filled
            .map(|(rows, sum, right)| ReliabilityBin {
                rows,
                confidence: sum / rows as f64,
                accuracy: right as f64 / rows as f64,
            })
            .collect();
        let gap = |bin: &ReliabilityBin| bin.rows as f64 * (bin.accuracy - bin.confidence).abs();
        let ece = bins.iter().map(gap).sum::<f64>() / n;
        let scale = if classes == 2 { 0.5 } else { 1.0 };
        Self { brier: scale * brier / n, ece, bins }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn classes_without_probabilities_have_none() {
        let p = array![[0.8, 0.2], [0.5, 0.5]];
        let known = Reliability::new(&[(0, p.row(0)), (1, p.row(1))], 2);
        assert!((known.brier - (0.08 + 0.5) / 4.0).abs() < 1e-12);
        // The second row is of a third class: its probability is 0 where 1 is right.
        let strange = Reliability::new(&[(0, p.row(0)), (2, p.row(1))], 3);
        assert!((strange.brier - (0.08 + 1.5) / 2.0).abs() < 1e-12);
    }
}
