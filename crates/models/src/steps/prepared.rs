//! Training rows behind steps that were fitted on them.

use ndarray::{ArrayView2, CowArray, Ix2};

use super::{Step, StepSpec};
use crate::error::Result;

/// Rows `[rows, features]` through all `steps` in order.
///
/// # Errors
/// Another number of features than in training, or features that are not finite.
pub fn through<'a>(steps: &[Step], x: ArrayView2<'a, f64>) -> Result<CowArray<'a, f64, Ix2>> {
    let mut current = CowArray::from(x);
    for step in steps {
        current = step.transform(current.view())?.into();
    }
    Ok(current)
}

/// Fitted steps with the training rows behind them: made once, for every classifier that follows.
#[derive(Clone, Debug)]
pub struct Prepared<'a> {
    steps: Vec<Step>,
    rows: CowArray<'a, f64, Ix2>,
}

impl<'a> Prepared<'a> {
    /// Fits every step on what the one before it gives.
    ///
    /// # Errors
    /// Whatever a step refuses.
    pub fn fit(specs: &[StepSpec], x: ArrayView2<'a, f64>) -> Result<Self> {
        let mut steps = Vec::with_capacity(specs.len());
        let mut rows = CowArray::from(x);
        for spec in specs {
            let step = spec.fit(rows.view())?;
            rows = step.transform(rows.view())?.into();
            steps.push(step);
        }
        Ok(Self { steps, rows })
    }

    /// The fitted steps.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The training rows behind them.
    pub fn rows(&self) -> ArrayView2<'_, f64> {
        self.rows.view()
    }

    /// The fitted steps alone.
    pub fn into_steps(self) -> Vec<Step> {
        self.steps
    }
}
