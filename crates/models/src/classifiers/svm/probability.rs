//! Probabilities from decision values: Platt's sigmoid (Lin, Lin & Weng 2007) and pairwise
//! coupling (Wu, Lin & Weng 2004, second method).

use ndarray::{Array1, Array2, ArrayView2};
use serde::{Deserialize, Serialize};

/// P(first class | decision d) = 1 / (1 + exp(a·d + b)).
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Sigmoid {
    a: f64,
    b: f64,
}

impl Sigmoid {
    /// The probability at decision value `d`.
    pub(super) fn at(self, d: f64) -> f64 {
        let z = self.a * d + self.b;
        if z >= 0.0 { (-z).exp() / (1.0 + (-z).exp()) } else { 1.0 / (1.0 + z.exp()) }
    }

    pub(super) fn is_finite(self) -> bool {
        self.a.is_finite() && self.b.is_finite()
    }

    /// Newton's method with backtracking on the regularised cross entropy.
    pub(super) fn fit(decisions: &[f64], signs: &[f64]) -> Self {
        let positive = signs.iter().filter(|&&s| s > 0.0).count() as f64;
        let negative = signs.len() as f64 - positive;
        let (high, low) = ((positive + 1.0) / (positive + 2.0), 1.0 / (negative + 2.0));
        let data: Vec<(f64, f64)> = decisions
            .iter()
            .zip(signs)
            .map(|(&d, &s)| (d, if s > 0.0 { high } else { low }))
            .collect();
        let loss = |s: Self| -> f64 {
            let term = |&(d, target): &(f64, f64)| {
                let z = s.a * d + s.b;
                let tail = (-z.abs()).exp().ln_1p();
                if z >= 0.0 { target * z + tail } else { (target - 1.0) * z + tail }
            };
            data.iter().map(term).sum()
        };
        let mut now = Self { a: 0.0, b: ((negative + 1.0) / (positive + 1.0)).ln() };
        let mut value = loss(now);
        for _ in 0..100 {
            // Hessian (with a little on the diagonal) and gradient.
            let (mut aa, mut bb, mut ab) = (1e-12, 1e-12, 0.0);
            let (mut ga, mut gb) = (0.0, 0.0);
            for &(d, target) in &data {
                let p = now.at(d);
                let curvature = p * (1.0 - p);
                aa += d * d * curvature;
                bb += curvature;
                ab += d * curvature;
                ga += d * (target - p);
                gb += target - p;
            }
            if f64::max(ga.abs(), gb.abs()) < 1e-5 {
                break;
            }
            let det = aa * bb - ab * ab;
            let (da, db) = (-(bb * ga - ab * gb) / det, -(aa * gb - ab * ga) / det);
            let descent = ga * da + gb * db;
            let mut step = 1.0;
            let better = loop {
                let next = Self { a: now.a + step * da, b: now.b + step * db };
                let next_value = loss(next);
                if next_value < value + 1e-4 * step * descent {
                    break Some((next, next_value));
                }
                step /= 2.0;
                if step < 1e-10 {
                    break None;
                }
            };
            let Some(better) = better else { break };
            (now, value) = better;
        }
        now
    }
}

/// Class probabilities p that agree best with the pairwise ones: `pairwise[i, j]` is P(i | i or j).
pub(super) fn couple(pairwise: ArrayView2<'_, f64>) -> Array1<f64> {
    let k = pairwise.nrows();
    let mut q = Array2::zeros((k, k));
    for t in 0..k {
        for j in (0..k).filter(|&j| j != t) {
            q[[t, t]] += pairwise[[j, t]] * pairwise[[j, t]];
            q[[t, j]] = -pairwise[[j, t]] * pairwise[[t, j]];
        }
    }
    let mut p = Array1::from_elem(k, 1.0 / k as f64);
    for _ in 0..k.max(100) {
        let mut qp = q.dot(&p);
        let mut pqp = p.dot(&qp);
        let worst = qp.iter().fold(0.0f64, |worst, v| worst.max((v - pqp).abs()));
        if worst < 0.005 / k as f64 {
            break;
        }
        for t in 0..k {
            let change = (pqp - qp[t]) / q[[t, t]];
            p[t] += change;
            let scale = 1.0 + change;
            pqp = (pqp + change * (change * q[[t, t]] + 2.0 * qp[t])) / scale / scale;
            for j in 0..k {
                qp[j] = (qp[j] + change * q[[t, j]]) / scale;
                p[j] /= scale;
            }
        }
    }
    let sum = p.sum();
    p / sum
}
