//! One decision from the windows of a recording.

use crate::error::{ModelError, Result};
use crate::fusion::{Background, WindowVotes};
use crate::labels::Labels;
use crate::table::argmax;

/// How windows are made one decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VotingRule {
    /// The class that most windows have; its probabilities are shares of windows.
    Majority(Option<Background>),
    /// The class of the highest mean probability.
    Mean,
}

/// A class and its probabilities (shares of windows for a majority).
pub type Decision = (usize, Option<Vec<f64>>);

impl VotingRule {
    /// A majority in which `label` wins only where no other class has `least` windows.
    ///
    /// # Errors
    /// [`ModelError::UnknownName`] for a label outside the table.
    pub fn majority_over(label: &str, least: usize, labels: &Labels) -> Result<Self> {
        let class = labels.encode(&[label])?[0];
        Ok(Self::Majority(Some(Background { class, least })))
    }

    /// The decision of the windows; `None` without any.
    ///
    /// # Errors
    /// [`ModelError::NoProbability`] for a mean over windows without probabilities.
    pub fn decide(self, votes: &WindowVotes) -> Result<Option<Decision>> {
        match self {
            Self::Majority(background) => {
                Ok(votes.majority(background).map(|class| (class, Some(votes.shares()))))
            }
            Self::Mean if votes.windows() == 0 => Ok(None),
            Self::Mean => {
                let mean = votes.mean().ok_or(ModelError::NoProbability {
                    owner: "classifier",
                    remedy: "a vote by mean needs them; use a vote by majority",
                })?;
                Ok(Some((argmax(&mean), Some(mean))))
            }
        }
    }
}
