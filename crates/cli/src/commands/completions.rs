//! `corsmal-feat completions`: shell completions and the man page, from the argument definitions.

use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, ValueEnum};
use clap_complete::Shell;

use crate::failure::Failure;

/// What to print.
#[derive(Clone, Copy, ValueEnum)]
enum Target {
    Bash,
    Zsh,
    Fish,
    Elvish,
    Powershell,
    /// The manual page (roff).
    Man,
}

/// Arguments of `completions`.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  corsmal-feat completions bash > ~/.local/share/bash-completion/completions/corsmal-feat\n  corsmal-feat completions man > corsmal-feat.1"
)]
pub struct Args {
    /// A shell, or `man` for the manual page.
    #[arg(value_enum)]
    target: Target,
}

/// Prints the completion script or page to standard output.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let mut command = crate::Cli::command();
    let mut text = Vec::new();
    let shell = match args.target {
        Target::Bash => Some(Shell::Bash),
        Target::Zsh => Some(Shell::Zsh),
        Target::Fish => Some(Shell::Fish),
        Target::Elvish => Some(Shell::Elvish),
        Target::Powershell => Some(Shell::PowerShell),
        Target::Man => None,
    };
    match shell {
        Some(shell) => {
            clap_complete::generate(shell, &mut command, "corsmal-feat", &mut text);
        }
        None => clap_mangen::Man::new(command).render(&mut text)?,
    }
    std::io::stdout().write_all(&text)?;
    Ok(ExitCode::SUCCESS)
}
