//! One file per command: its arguments (`Args`) and what it does (`run`).

mod completions;
mod extract;
mod features;
mod merge;
mod presets;

use std::process::ExitCode;

use clap::Subcommand;

use crate::failure::Failure;

/// Registration: a command is its file, a variant here and a line in `run`.
#[derive(Subcommand)]
pub enum Command {
    /// Recordings in, feature tensors or tables out.
    Extract(extract::Args),
    /// Join the outputs of all shards of a run.
    Merge(merge::Args),
    /// List and explain the configurations that come with the tool.
    Presets(presets::Args),
    /// List the features that a configuration can name.
    Features(features::Args),
    /// Print shell completions or the man page.
    Completions(completions::Args),
}

impl Command {
    /// Runs the command to its exit code.
    pub fn run(self) -> Result<ExitCode, Failure> {
        match self {
            Self::Extract(args) => extract::run(args),
            Self::Merge(args) => merge::run(args),
            Self::Presets(args) => presets::run(args),
            Self::Features(args) => features::run(args),
            Self::Completions(args) => completions::run(args),
        }
    }
}
