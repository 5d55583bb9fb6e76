//! Scores of submissions under the rules of the paper and of the official evaluators.

mod density;
mod mass;
mod regression;
mod rule_set;
mod rules;

pub use corsmal_models::scores::{ClassScores, ConfusionMatrix};
pub use density::DensityTable;
pub use mass::object_weight;
pub use rule_set::{RuleSet, Scores};
pub use rules::evaluate;
