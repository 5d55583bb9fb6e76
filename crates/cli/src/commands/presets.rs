//! `corsmal-feat presets`: the configurations that come with the tool, and what their numbers are.

use std::process::ExitCode;

use corsmal_extract::config::{Config, PRESETS, Preset};

use crate::failure::Failure;

/// Arguments of `presets`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat presets                       list them
  corsmal-feat presets esc26                 what each number of the output is
  corsmal-feat presets esc26 --toml > my.toml   a configuration file to start from")]
pub struct Args {
    /// A preset to explain; without it they are listed.
    name: Option<String>,
    /// Print the configuration file itself.
    #[arg(long, requires = "name")]
    toml: bool,
}

/// Lists or explains presets.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Some(name) = args.name else {
        for preset in PRESETS {
            println!("{:<16} {}", preset.name, preset.description());
        }
        return Ok(ExitCode::SUCCESS);
    };
    let preset = Preset::find(&name)?;
    if args.toml {
        print!("{}", preset.toml);
        return Ok(ExitCode::SUCCESS);
    }
    let config = Config::preset(&name)?;
    println!("{}\n\nConfiguration hash: {}\n", preset.description(), config.hash());
    for feature in &config.features {
        println!("{}: {}", feature.name(), feature.about());
        if let Some([first, end]) = feature.coefficients() {
            println!("  kept: coefficients {first} to {}", end - 1);
        }
        println!("  {}\n", feature.to_value());
    }
    match &config.summary {
        None => println!(
            "Output: for each recording and feature an array [channels, coefficients, frames]."
        ),
        Some(summary) => {
            let stats: Vec<String> = summary.stats.iter().map(ToString::to_string).collect();
            println!(
                "Output: one row a recording; for each feature {} over its frames, {}.",
                stats.join(", "),
                if summary.average_channels { "channels averaged" } else { "channel by channel" }
            );
        }
    }
    Ok(ExitCode::SUCCESS)
}
