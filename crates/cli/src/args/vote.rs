//! How windows are made one decision.

use clap::ValueEnum;
use corsmal_models::labels::Labels;
use corsmal_models::voting::VotingRule;

use crate::failure::Failure;

/// A way to decide.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum How {
    /// The class of most windows; `p_<label>` is the share of windows.
    Majority,
    /// The class with the highest mean probability.
    Mean,
}

/// Arguments about windows.
#[derive(clap::Args)]
pub struct VoteArgs {
    /// Write one line per recording, decided by its windows.
    #[arg(long, value_enum, value_name = "HOW")]
    vote: Option<How>,
    /// Class of windows in which nothing happens: with --vote majority it wins only if no other class
    /// has --least windows.
    #[arg(long, value_name = "LABEL", requires = "vote")]
    background: Option<String>,
    /// Windows that a class other than --background needs.
    #[arg(long, value_name = "N", requires = "background", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    least: u32,
}

impl VoteArgs {
    /// A vote with a background is more than shares of windows: it is lost where only these are
    /// gone on with.
    pub fn refuse_background(&self, with: &str) -> Result<(), Failure> {
        match self.background {
            Some(_) => Err(Failure::new(format!(
                "--background works on the windows of one file: it cannot be combined with {with}"
            ))),
            None => Ok(()),
        }
    }

    /// The rule for these classes; `None` without `--vote`.
    pub fn rule(&self, labels: &Labels) -> Result<Option<VotingRule>, Failure> {
        match (self.vote, &self.background) {
            (None, _) => Ok(None),
            (Some(How::Majority), None) => Ok(Some(VotingRule::Majority(None))),
            (Some(How::Majority), Some(label)) => {
                VotingRule::majority_over(label, self.least as usize, labels)
                    .map(Some)
                    .map_err(|e| Failure::new(format!("--background: {e}")))
            }
            (Some(How::Mean), None) => Ok(Some(VotingRule::Mean)),
            (Some(How::Mean), Some(_)) => Err(Failure::new("--background needs --vote majority")),
        }
    }
}
