//! One file per command: its arguments (`Args`) and what it does (`run`).

mod completions;
mod inspect;

use std::process::ExitCode;

use clap::Subcommand;

use crate::failure::Failure;

/// Registration: a command is its file, a variant here and a line in `run`.
#[derive(Subcommand)]
pub enum Command {
    /// Show format and health of a recording, with a picture on request.
    Inspect(inspect::Args),
    /// Print shell completions or the man page.
    Completions(completions::Args),
}

impl Command {
    /// Runs the command to its exit code.
    pub fn run(self) -> Result<ExitCode, Failure> {
        match self {
            Self::Inspect(args) => inspect::run(args),
            Self::Completions(args) => completions::run(args),
        }
    }
}
