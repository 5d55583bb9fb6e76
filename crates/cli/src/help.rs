//! The help of the command: what it can do, in groups.

use clap::{Arg, Command, CommandFactory, FromArgMatches};

use crate::commands::Cli;

/// Commands by what they are about. A command in none of them is listed last.
const GROUPS: [(&str, &[&str]); 4] = [
    ("Features", &["demo", "extract", "presets", "features", "inspect", "pca"]),
    (
        "Models",
        &[
            "train",
            "classify",
            "cross-validate",
            "score",
            "compare-predictions",
            "fuse",
            "classifiers",
            "nets",
            "embed",
        ],
    ),
    ("Files", &["compare", "merge", "completions"]),
    ("CORSMAL", &["benchmark", "capacity", "crops", "detect", "evaluate", "dataset", "synth"]),
];

const EXIT_CODES: &str = "\
Exit codes: 0 all fine, 1 finished with failed files, 2 could not run, 130 interrupted.";

/// Parses the arguments of the process; ends it for help, version and errors.
pub fn parse() -> Cli {
    let matches = grouped(with_negative_values(Cli::command())).get_matches();
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

/// The same command where -1 after an option is its value, so that what refuses it can say why.
fn with_negative_values(command: Command) -> Command {
    let takes_values = |argument: &Arg| {
        argument.get_action().takes_values()
            && !argument.is_positional()
            && !argument.is_allow_hyphen_values_set()
    };
    command
        .mut_args(|arg| if takes_values(&arg) { arg.allow_negative_numbers(true) } else { arg })
        .mut_subcommands(with_negative_values)
}

/// The same command with its subcommands in groups.
pub fn grouped(command: Command) -> Command {
    let known = |name: &str| GROUPS.iter().any(|(_, names)| names.contains(&name));
    let others: Vec<&str> =
        command.get_subcommands().map(Command::get_name).filter(|name| !known(name)).collect();
    let mut lists = String::new();
    for (heading, names) in GROUPS.into_iter().chain([("Other", others.as_slice())]) {
        let found: Vec<&Command> =
            names.iter().filter_map(|name| command.find_subcommand(name)).collect();
        if found.is_empty() {
            continue;
        }
        lists += &format!("{heading}:\n");
        for subcommand in found {
            let about = subcommand.get_about().map(ToString::to_string).unwrap_or_default();
            lists += &format!("  {:<20} {about}\n", subcommand.get_name());
        }
        lists.push('\n');
    }
    command.help_template(format!(
        "start: corsmal-feat demo\n\n{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{lists}\
         Options:\n{{options}}\n\n`corsmal-feat COMMAND --help` shows arguments and examples.\n\
         {EXIT_CODES}\n"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(command: &Command, check: &mut dyn FnMut(&Command)) {
        check(command);
        command.get_subcommands().for_each(|subcommand| all(subcommand, check));
    }

    #[test]
    fn options_have_the_same_letters_in_every_command() {
        all(&Cli::command(), &mut |command| {
            for (long, short) in [("out", 'o'), ("jobs", 'j'), ("quiet", 'q')] {
                for argument in command.get_arguments().filter(|a| a.get_long() == Some(long)) {
                    assert_eq!(
                        argument.get_short(),
                        Some(short),
                        "{}: --{long}",
                        command.get_name()
                    );
                }
            }
        });
    }
}
