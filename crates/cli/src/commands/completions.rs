//! `corsmal-feat completions`: shell completions and the man page, from the argument definitions.

use std::process::ExitCode;

use clap::{Command, ValueEnum};
use clap_complete::Shell;
use clap_mangen::Man;

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
    after_help = "Examples:\n  corsmal-feat completions bash > ~/.local/share/bash-completion/completions/corsmal-feat\n  corsmal-feat completions man > corsmal-feat.1\n  corsmal-feat completions man extract > corsmal-feat-extract.1"
)]
pub struct Args {
    /// A shell, or `man` for the manual page.
    #[arg(value_enum)]
    target: Target,
    /// With `man`: the page of one command instead of the overview.
    command: Option<String>,
}

/// Prints the completion script or page of `command`, the whole tool, to standard output.
pub fn run(args: Args, mut command: Command) -> Result<ExitCode, Failure> {
    let mut text = Vec::new();
    let shell = match args.target {
        Target::Bash => Shell::Bash,
        Target::Zsh => Shell::Zsh,
        Target::Fish => Shell::Fish,
        Target::Elvish => Shell::Elvish,
        Target::Powershell => Shell::PowerShell,
        Target::Man => {
            man_page(command, args.command.as_deref())?.render(&mut text)?;
            print!("{}", String::from_utf8_lossy(&text));
            return Ok(ExitCode::SUCCESS);
        }
    };
    if let Some(name) = args.command {
        return Err(Failure::new(format!("{name}: only `man` has a page per command")));
    }
    clap_complete::generate(shell, &mut command, "corsmal-feat", &mut text);
    print!("{}", String::from_utf8_lossy(&text));
    Ok(ExitCode::SUCCESS)
}

/// The page of the tool, or of one of its commands.
fn man_page(mut tool: Command, name: Option<&str>) -> Result<Man, Failure> {
    let Some(name) = name else { return Ok(Man::new(tool)) };
    // Fills in what commands inherit from the tool.
    tool.build();
    let Some(command) = tool.find_subcommand(name) else {
        let known: Vec<&str> = tool.get_subcommands().map(Command::get_name).collect();
        let known = known.join(", ");
        return Err(Failure::new(format!("command \"{name}\" is unknown: {known}")));
    };
    let title = format!("corsmal-feat-{name}");
    Ok(Man::new(command.clone()).title(title))
}
