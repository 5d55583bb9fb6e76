//! `corsmal-feat presets`: the configurations that come with the tool, and what their numbers are.

use std::process::ExitCode;
use std::sync::Arc;

use corsmal_extract::config::{Config, PRESETS, Preset, SignalConfig};
use corsmal_extract::engine::{Plan, channels_out};

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
            println!("{:<16} {}", preset.name, Config::preset(preset.name)?.description);
        }
        return Ok(ExitCode::SUCCESS);
    };
    let preset = Preset::find(&name)?;
    if args.toml {
        print!("{}", preset.toml);
        return Ok(ExitCode::SUCCESS);
    }
    let config = Arc::new(Config::preset(&name)?);
    println!("{}\n\nConfiguration hash: {}\n", config.description, config.hash());
    for feature in &config.features {
        println!("{}: {}", feature.name(), feature.about());
        if let Some([first, end]) = feature.coefficients() {
            println!("  kept: coefficients {first} to {}", end - 1);
        }
        println!("  {}\n", feature.to_value());
    }
    if let Some(changes) = signal_changes(&config) {
        println!("Signal: {changes}\n");
    }
    match &config.summary {
        None => println!(
            "Output: for each recording and feature an array [channels, coefficients, frames], and the \
             times of its frames in seconds."
        ),
        Some(_) => println!("Output: one row a recording. {}", columns(&config)?),
    }
    Ok(ExitCode::SUCCESS)
}

/// Keys of the front end that are not at their defaults.
fn signal_changes(config: &Config) -> Option<String> {
    let (set, default) = (config.to_value(), serde_json::json!(SignalConfig::default()));
    let changed = set["signal"].as_object()?.iter().filter(|(key, value)| default[*key] != **value);
    let changed: Vec<String> = changed.map(|(key, value)| format!("{key} = {value}")).collect();
    (!changed.is_empty()).then(|| changed.join(", "))
}

/// Number, order and names of the columns, for recordings as those of the CCM data set.
fn columns(config: &Arc<Config>) -> Result<String, Failure> {
    const CHANNELS: usize = 8;
    const RATE: f64 = 44_100.0;
    let channels = channels_out(&config.signal.channels, CHANNELS).map_err(Failure::new)?;
    let rate = if config.signal.sample_rate > 0.0 { config.signal.sample_rate } else { RATE };
    let names = Plan::new(config, rate, channels)?.summary_names();
    let (first, last) = (names.first(), names.last());
    Ok(format!(
        "Of {CHANNELS} channels at {RATE} Hz, {} columns, {} to {}: feature by feature, in it statistic \
         by statistic, in that channel by channel.",
        names.len(),
        first.map_or("", String::as_str),
        last.map_or("", String::as_str)
    ))
}
