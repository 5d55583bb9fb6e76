//! The `corsmal-feat` command: parse arguments, run one command, turn its end into an exit code.

#[macro_use]
mod streams;

mod commands;
mod dataset_table;
mod failure;
mod folds;
mod interrupt;
mod label_file;
mod pipeline;
mod prediction_lines;
mod progress;
mod publish;
mod voting;

use std::process::ExitCode;

use clap::Parser;

use commands::Command;

/// Features of multi-channel recordings, classifiers, and the CORSMAL benchmark.
#[derive(Parser)]
#[command(name = "corsmal-feat", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match cli.command.run() {
        Ok(code) => code,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::from(failure::COULD_NOT_RUN)
        }
    }
}
