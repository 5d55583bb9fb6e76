//! `corsmal-feat presets`: the configurations that come with the tool, and what their numbers are.

use std::process::ExitCode;
use std::sync::Arc;

use corsmal_extract::config::{Channels, Config, PRESETS, Preset, SignalConfig};
use corsmal_extract::engine::{Plan, PlannedFeature, channels_out};

use crate::failure::Failure;
use crate::paragraphs::wrapped;
use crate::text_table::TextTable;

/// Arguments of `presets`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat presets                       list them
  corsmal-feat presets esc26                 what each number of the output is
  corsmal-feat presets esc26 --toml > my.toml   a configuration file to start from")]
pub struct Args {
    /// A preset to explain; without it, all presets are listed.
    name: Option<String>,
    /// Print the configuration file itself.
    #[arg(long, requires = "name")]
    toml: bool,
    /// Print everything as JSON: the whole configuration, every key with its value.
    #[arg(long, conflicts_with = "toml")]
    json: bool,
}

/// Recordings as those of the CCM data set, by which columns are counted.
const CHANNELS: usize = 8;
const RATE: f64 = 44_100.0;

/// Lists or explains presets.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Some(name) = args.name else {
        if args.json {
            let all = PRESETS.iter().map(described).collect::<Result<Vec<_>, _>>()?;
            println!("{}", serde_json::to_string_pretty(&all)?);
            return Ok(ExitCode::SUCCESS);
        }
        list()?;
        return Ok(ExitCode::SUCCESS);
    };
    let preset = Preset::find(&name)?;
    if args.toml {
        print!("{}", preset.toml);
        return Ok(ExitCode::SUCCESS);
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&described(preset)?)?);
        return Ok(ExitCode::SUCCESS);
    }
    let config = Arc::new(Config::preset(&name)?);
    println!("{}\n\nConfiguration hash: {}\n", wrapped(&config.description, ""), config.hash());
    for feature in &config.features {
        println!("{}", wrapped(&format!("{}: {}", feature.name(), feature.about()), ""));
        if let Some([first, end]) = feature.coefficients() {
            println!("  kept: coefficients {first} to {}", end - 1);
        }
        println!();
    }
    if let Some(changes) = signal_changes(&config) {
        println!("{}\n", wrapped(&format!("Signal: {changes}"), ""));
    }
    let output = match &config.summary {
        None => {
            "Output: for each recording and feature, an array [channels, coefficients, frames] \
             and the times of its frames in seconds."
                .to_string()
        }
        Some(_) => format!("Output: one row per recording. {}", columns(&config)?),
    };
    println!("{}\n", wrapped(&output, ""));
    println!("As a file (every other key has its default: corsmal-feat features NAME):\n");
    let body = preset.toml.lines().skip_while(|line| line.starts_with("description"));
    body.skip_while(|line| line.is_empty()).for_each(|line| println!("  {line}"));
    Ok(ExitCode::SUCCESS)
}

/// A preset with its hash and all that it says.
fn described(preset: &Preset) -> Result<serde_json::Value, Failure> {
    let config = Config::preset(preset.name)?;
    Ok(serde_json::json!({
        "name": preset.name,
        "description": config.description,
        "config_hash": config.hash(),
        "config": config.to_value(),
    }))
}

/// A table: what each preset computes of what, and how much.
fn list() -> Result<(), Failure> {
    let heads = ["preset", "channels", "rate", "output of a recording"];
    let mut table = TextTable::new(heads).left(&[1, 2, 3]);
    for preset in PRESETS {
        let config = Arc::new(Config::preset(preset.name)?);
        let channels = match &config.signal.channels {
            Channels::All => "each".into(),
            Channels::Mean => "mean".into(),
            Channels::Downmix71 => "7.1 mix".into(),
            Channels::List(list) => list.iter().map(usize::to_string).collect::<Vec<_>>().join(","),
        };
        let rate = match config.signal.sample_rate {
            0.0 => "its own".into(),
            rate => format!("{rate} Hz"),
        };
        table.row([preset.name.into(), channels, rate, size(&config)?]);
    }
    println!("{}\n", table.text());
    let width = PRESETS.iter().map(|preset| preset.name.len()).max().unwrap_or(0);
    for preset in PRESETS {
        let indent = " ".repeat(width + 2);
        let description = wrapped(&Config::preset(preset.name)?.description, &indent);
        println!("{:<width$}  {}", preset.name, description.trim_start());
    }
    Ok(())
}

/// Numbers of a recording, for each channel where channels stay apart.
fn size(config: &Arc<Config>) -> Result<String, Failure> {
    let each = config.signal.channels == Channels::All;
    let apart = each && !config.summary.as_ref().is_some_and(|s| s.average_channels);
    let plan = plan(config, 1)?;
    let of = if apart { " a channel" } else { "" };
    if config.summary.is_some() {
        return Ok(format!("{} columns{of}", plan.summary_names().len()));
    }
    let array = |feature: &PlannedFeature| match plan.hop(&feature.name) {
        0.0 => format!("{} {}", feature.labels.len(), feature.name),
        _ => format!("{} {} x frames", feature.labels.len(), feature.name),
    };
    let arrays: Vec<String> = plan.features.iter().map(array).collect();
    Ok(format!("{}{of}", arrays.join(", ")))
}

fn plan(config: &Arc<Config>, channels: usize) -> Result<Plan, Failure> {
    let rate = if config.signal.sample_rate > 0.0 { config.signal.sample_rate } else { RATE };
    Ok(Plan::new(config, rate, channels)?)
}

/// Keys of `[signal]` that are not at their defaults.
fn signal_changes(config: &Config) -> Option<String> {
    let (set, default) = (config.to_value(), serde_json::json!(SignalConfig::default()));
    let changed = set["signal"].as_object()?.iter().filter(|(key, value)| default[*key] != **value);
    let changed: Vec<String> = changed.map(|(key, value)| format!("{key} = {value}")).collect();
    (!changed.is_empty()).then(|| changed.join(", "))
}

/// Number, order and names of the columns, for recordings as those of the CCM data set.
fn columns(config: &Arc<Config>) -> Result<String, Failure> {
    let channels = channels_out(&config.signal.channels, CHANNELS).map_err(Failure::new)?;
    let names = plan(config, channels)?.summary_names();
    let (first, last) = (names.first(), names.last());
    Ok(format!(
        "For {CHANNELS} channels at {RATE} Hz, {} columns, {} to {}: by feature, then by \
         statistic, then by channel.",
        names.len(),
        first.map_or("", String::as_str),
        last.map_or("", String::as_str)
    ))
}
