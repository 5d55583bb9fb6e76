//! One file per command: its arguments (`Args`) and what it does (`run`).

mod completions;

use std::process::ExitCode;

use clap::Subcommand;

use crate::failure::Failure;

/// Registration: a command is its file, a variant here and a line in `run`.
#[derive(Subcommand)]
pub enum Command {
    /// Print shell completions or the man page.
    Completions(completions::Args),
}

impl Command {
    /// Runs the command to its exit code.
    pub fn run(self) -> Result<ExitCode, Failure> {
        match self {
            Self::Completions(args) => completions::run(args),
        }
    }
}
