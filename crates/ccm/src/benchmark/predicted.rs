//! Everything that a benchmark predicted.

use super::added::Placed;
use super::baselines::Outcome;
use super::system::Run;

/// Baselines, systems and prediction files.
pub(super) struct Predicted<'a> {
    pub(super) outcomes: &'a [Outcome],
    pub(super) runs: &'a [Run],
    pub(super) added: &'a [Placed],
}
