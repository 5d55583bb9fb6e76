//! The `corsmal-feat` command: parse arguments, run one command, turn its end into an exit code.

#[macro_use]
mod streams;

mod args;
mod commands;
mod configuration;
mod failure;
mod help;
mod interrupt;
mod made;
#[cfg(feature = "nets")]
mod networks;
mod output;
mod paragraphs;
mod plural;
mod progress;
mod publish;
mod recordings;
mod study;
mod text_table;

use std::process::ExitCode;

fn main() -> ExitCode {
    corsmal_files::memory::keep_freed();
    let cli = help::parse();
    match cli.run() {
        Ok(code) => code,
        Err(failure) => {
            streams::err_lines(&format!("error: {failure}"));
            ExitCode::from(failure.code())
        }
    }
}
