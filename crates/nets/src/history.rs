//! How far a training is, and what became of it.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// What became of an epoch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Epoch {
    /// mean loss of its steps
    pub loss: f64,
    /// score on the rows watched, where there are some
    pub score: Option<f64>,
}

/// What became of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct History {
    /// epoch by epoch
    pub epochs: Vec<Epoch>,
    /// the epoch whose numbers were kept, from 0
    pub kept: usize,
}

/// Where a training is.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// epochs done
    pub epochs: &'a [Epoch],
    /// the step of an epoch that is about to begin, from 0; `None` between epochs
    pub step: Option<usize>,
    /// epochs in all
    pub total: usize,
    /// time since the start
    pub elapsed: Duration,
    /// time that is left, as the part done lets expect; before the first epoch from a trial step
    pub left: Duration,
    /// bytes of memory that the training takes, roughly
    pub memory: u64,
}
