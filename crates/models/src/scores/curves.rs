//! One class against the others: receiver operating characteristic, precision and recall.

use serde::Serialize;

/// Curves of one class against all others, and the areas under them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassCurves {
    /// area under the ROC curve (scikit-learn's `roc_auc_score`)
    pub roc_auc: f64,
    /// average precision (scikit-learn's `average_precision_score`)
    pub average_precision: f64,
    /// false positive rate and true positive rate, from (0, 0) to (1, 1), without points on straight
    /// stretches
    pub roc: Vec<(f64, f64)>,
    /// recall and precision, thresholds descending
    pub precision_recall: Vec<(f64, f64)>,
}

impl ClassCurves {
    /// Of probabilities of the class and whether it is the true one; `None` unless there are rows of
    /// both kinds.
    pub(super) fn new(rows: &[(f64, bool)]) -> Option<Self> {
        let positive = rows.iter().filter(|(_, is)| *is).count() as f64;
        let negative = rows.len() as f64 - positive;
        if positive == 0.0 || negative == 0.0 {
            return None;
        }
        let mut sorted = rows.to_vec();
        sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (mut hits, mut alarms) = (0.0, 0.0);
        let mut roc = vec![(0.0, 0.0)];
        let mut precision_recall: Vec<(f64, f64)> = Vec::new();
        let (mut roc_auc, mut average_precision) = (0.0, 0.0);
        for (at, (p, is)) in sorted.iter().enumerate() {
            hits += f64::from(u8::from(*is));
            alarms += f64::from(u8::from(!*is));
            // Rows of one probability are one threshold.
            if sorted.get(at + 1).is_some_and(|(next, _)| next == p) {
                continue;
            }
            let (rate, recall) = (alarms / negative, hits / positive);
            let (last_rate, last_recall) = roc[roc.len() - 1];
            roc_auc += (rate - last_rate) * (recall + last_recall) / 2.0;
            let precision = hits / (hits + alarms);
            average_precision += (recall - last_recall) * precision;
            roc.push((rate, recall));
            precision_recall.push((recall, precision));
        }
        Some(Self { roc_auc, average_precision, roc: without_straight(roc), precision_recall })
    }
}

/// Leaves out points between two others on a horizontal or vertical stretch.
fn without_straight(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::with_capacity(points.len());
    for point in points {
        if let [.., a, b] = kept[..]
            && ((a.0 == b.0 && b.0 == point.0) || (a.1 == b.1 && b.1 == point.1))
        {
            kept.pop();
        }
        kept.push(point);
    }
    kept
}
