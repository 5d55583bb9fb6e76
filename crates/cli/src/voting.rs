//! One decision from the windows of a recording.

use clap::ValueEnum;
use corsmal_models::argmax;
use corsmal_models::fusion::{Background, WindowVotes};
use corsmal_models::labels::Labels;

use crate::failure::Failure;

/// How windows are made one decision.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum How {
    /// The class that most windows have; `p_<label>` is the share of windows.
    Majority,
    /// The class of the highest mean probability.
    Mean,
}

/// Arguments about windows.
#[derive(clap::Args)]
pub struct VoteArgs {
    /// One line per recording, decided from its windows.
    #[arg(long, value_enum, value_name = "HOW")]
    vote: Option<How>,
    /// Class of windows in which nothing happens: with --vote majority it wins only where no other
    /// class has --least windows.
    #[arg(long, value_name = "LABEL", requires = "vote")]
    background: Option<String>,
    /// Windows that a class other than --background needs.
    #[arg(long, value_name = "N", requires = "background", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    least: u32,
}

/// A checked way to decide.
#[derive(Clone, Copy)]
pub enum Rule {
    /// By the number of windows.
    Majority(Option<Background>),
    /// By mean probability.
    Mean,
}

impl VoteArgs {
    /// A vote with a background is more than shares of windows: it is lost where only these are
    /// gone on with.
    pub fn refuse_background(&self, with: &str) -> Result<(), Failure> {
        match self.background {
            Some(_) => Err(Failure::new(format!(
                "--background decides over the windows of one file, not together with {with}"
            ))),
            None => Ok(()),
        }
    }

    /// The rule for these classes; `None` without `--vote`.
    pub fn rule(&self, labels: &Labels) -> Result<Option<Rule>, Failure> {
        let background = self.background.as_ref().map(|label| labels.encode(&[label]));
        let class = background
            .transpose()
            .map_err(|e| Failure::new(format!("--background: {e}")))?
            .map(|classes| classes[0]);
        match self.vote {
            None => Ok(None),
            Some(How::Majority) => {
                let background =
                    class.map(|class| Background { class, least: self.least as usize });
                Ok(Some(Rule::Majority(background)))
            }
            Some(How::Mean) if class.is_some() => {
                Err(Failure::new("--background goes with --vote majority only"))
            }
            Some(How::Mean) => Ok(Some(Rule::Mean)),
        }
    }
}

/// A class and its probabilities (shares of windows for a majority).
pub type Decision = (usize, Option<Vec<f64>>);

impl Rule {
    /// The decision of the windows; `None` without any.
    pub fn decide(self, votes: &WindowVotes) -> Result<Option<Decision>, Failure> {
        match self {
            Self::Majority(background) => {
                Ok(votes.majority(background).map(|class| (class, Some(votes.shares()))))
            }
            Self::Mean if votes.windows() == 0 => Ok(None),
            Self::Mean => {
                let mean = votes.mean().ok_or_else(|| {
                    Failure::new("--vote mean needs probabilities, which this classifier lacks")
                })?;
                Ok(Some((argmax(&mean), Some(mean))))
            }
        }
    }
}
