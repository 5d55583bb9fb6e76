//! Losses.

use serde::{Deserialize, Serialize};

use crate::batch::Batch;
use crate::error::{NetError, Result};
use crate::matrix::Matrix;

/// What outputs are compared with.
#[derive(Clone, Debug, PartialEq)]
pub enum Targets {
    /// a class for each item
    Classes(Vec<usize>),
    /// numbers, as many as the network has outputs for each item
    Numbers(Vec<f32>),
}

impl Targets {
    /// Items.
    pub fn items(&self, outputs: usize) -> usize {
        match self {
            Self::Classes(classes) => classes.len(),
            Self::Numbers(numbers) => numbers.len() / outputs.max(1),
        }
    }

    /// The targets of these items.
    pub fn pick(&self, items: &[usize], outputs: usize) -> Self {
        match self {
            Self::Classes(c) => Self::Classes(items.iter().map(|&i| c[i]).collect()),
            Self::Numbers(v) => Self::Numbers(
                items.iter().flat_map(|&i| &v[i * outputs..(i + 1) * outputs]).copied().collect(),
            ),
        }
    }
}

/// A loss over a batch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// softmax and cross-entropy, PyTorch's weighted mean
    #[default]
    CrossEntropy,
    /// mean squared difference
    Mse,
}

impl Loss {
    /// Its value and the gradient by the outputs. `weights`: one for each class, empty for none.
    ///
    /// # Errors
    /// [`NetError::Targets`] when targets do not fit.
    pub fn of(&self, outputs: &Batch, targets: &Targets, weights: &[f32]) -> Result<(f64, Batch)> {
        let n = outputs.shape.len();
        let items = outputs.items();
        let refuse = |text: String| Err(NetError::Targets(text));
        let fits = match self {
            Self::CrossEntropy => matches!(targets, Targets::Classes(_)),
            Self::Mse => matches!(targets, Targets::Numbers(_)),
        };
        if fits && targets.items(n) != items {
            return refuse(format!("{} targets for {items} items", targets.items(n)));
        }
        let values = outputs.values.values();
        let mut gradient = vec![0.0f32; values.len()];
        let loss = match (self, targets) {
            (Self::CrossEntropy, Targets::Classes(classes)) => {
                if let Some(bad) = classes.iter().find(|&&c| c >= n) {
                    return refuse(format!("class {bad} for a network of {n} classes"));
                }
                if !weights.is_empty() && weights.len() != n {
                    return refuse(format!("{} class weights for {n} classes", weights.len()));
                }
                let weight = |c: usize| weights.get(c).map_or(1.0, |&w| f64::from(w));
                let total: f64 = classes.iter().map(|&c| weight(c)).sum();
                let mut loss = 0.0;
                let rows = values.chunks_exact(n).zip(gradient.chunks_exact_mut(n));
                for ((row, gradient), &class) in rows.zip(classes) {
                    let largest = row.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                    let exps: Vec<f64> =
                        row.iter().map(|&v| f64::from(v - largest).exp()).collect();
                    let sum: f64 = exps.iter().sum();
                    let w = weight(class) / total;
                    loss += w * (sum.ln() - f64::from(row[class] - largest));
                    for (c, (g, e)) in gradient.iter_mut().zip(&exps).enumerate() {
                        let target = if c == class { 1.0 } else { 0.0 };
                        *g = (w * (e / sum - target)) as f32;
                    }
                }
                loss
            }
            (Self::Mse, Targets::Numbers(numbers)) => {
                let count = values.len() as f64;
                let mut loss = 0.0;
                for ((g, &v), &t) in gradient.iter_mut().zip(values).zip(numbers) {
                    let d = f64::from(v) - f64::from(t);
                    loss += d * d / count;
                    *g = (2.0 * d / count) as f32;
                }
                loss
            }
            (Self::CrossEntropy, Targets::Numbers(_)) => {
                return refuse("cross-entropy needs classes: integers from 0 on".into());
            }
            (Self::Mse, Targets::Classes(_)) => {
                return refuse("the squared difference needs floating-point numbers".into());
            }
        };
        let values = Matrix::new(outputs.values.rows(), outputs.values.cols(), gradient);
        Ok((loss, Batch { values, shape: outputs.shape, lengths: None }))
    }
}
