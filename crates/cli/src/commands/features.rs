//! `corsmal-feat features`: every feature that a configuration can name.

use std::process::ExitCode;

use corsmal_extract::features::registry;

use crate::failure::Failure;

/// Arguments of `features`.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  corsmal-feat features mfcc")]
pub struct Args {
    /// A feature to show with its parameters and their defaults; without it all are listed.
    name: Option<String>,
}

/// Lists features.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let all = registry();
    match args.name {
        None => all.iter().for_each(|f| println!("{:<20} {}", f.kind(), f.about())),
        Some(name) => {
            let Some(feature) = all.iter().find(|f| f.kind() == name) else {
                let known: Vec<&str> = all.iter().map(|f| f.kind()).collect();
                let message = format!("feature \"{name}\" is unknown: {}", known.join(", "));
                return Err(Failure::new(message));
            };
            println!("{}\n\n[features.{name}]", feature.about());
            if let serde_json::Value::Object(parameters) = feature.defaults() {
                parameters.iter().for_each(|(key, value)| println!("{key} = {value}"));
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}
