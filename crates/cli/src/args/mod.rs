//! Arguments that several commands share.

mod dataset;
mod jobs;
mod network;
mod pipeline;
mod told;
mod vote;

pub use dataset::{DatasetArgs, LabelArgs, MemberArgs};
pub use jobs::Jobs;
pub use network::NetworkArgs;
pub use pipeline::PipelineArgs;
pub use told::Told;
pub use vote::VoteArgs;

/// A number from 0 to 1.
pub fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err(format!("{text:?}: expected a probability from 0 to 1")),
    }
}
