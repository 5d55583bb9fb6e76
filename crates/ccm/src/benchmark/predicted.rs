//! Everything that a benchmark predicted.

use super::added::Placed;
use super::baselines::BaselineResult;
use super::system::Run;

/// Baselines, systems, prediction files and capacities.
pub(super) struct Predicted<'a> {
    pub(super) outcomes: &'a [BaselineResult],
    pub(super) runs: &'a [Run],
    pub(super) added: &'a [Placed],
    /// Tables of capacities, with what a method that was run here takes.
    pub(super) capacities: &'a [(Placed, Option<&'static str>)],
    /// What makes scores of capacities doubtful.
    pub(super) cautions: &'a [String],
}
