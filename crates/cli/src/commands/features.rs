//! `corsmal-feat features`: every feature that a configuration can name.

use std::process::ExitCode;

use corsmal_extract::features::{find, kinds, registry};
use serde_json::Value;

use crate::failure::Failure;
use crate::paragraphs::wrapped;

/// Columns of the list that names take.
const NAMES: usize = 20;

/// Arguments of `features`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat features
  corsmal-feat features mfcc                 what it computes, every key with its default and meaning
  corsmal-feat features mfcc >> my.toml      the same as a part of a configuration file")]
pub struct Args {
    /// A feature to show with its parameters and their defaults; without it all are listed.
    name: Option<String>,
}

/// Lists features, or explains one as a table of a configuration file.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Some(name) = args.name else {
        for feature in registry() {
            let about = wrapped(feature.about(), &" ".repeat(NAMES + 1));
            println!("{:<NAMES$} {}", feature.kind(), about.trim_start());
        }
        return Ok(ExitCode::SUCCESS);
    };
    let Some(feature) = find(&name) else {
        let choices = corsmal_names::choices(&name, kinds());
        return Err(Failure::new(format!("feature \"{name}\" is unknown: {choices}")));
    };
    println!("{}", wrapped(feature.about(), "# "));
    if !feature.python().is_empty() {
        println!("# In Python: corsmal_feat.{}", feature.python());
    }
    println!("\n[features.{name}]");
    if let Value::Object(parameters) = feature.defaults() {
        for (key, value) in parameters {
            println!("{}", wrapped(feature.explain(&key).unwrap_or_default(), "# "));
            println!("{key} = {value}");
        }
    }
    Ok(ExitCode::SUCCESS)
}
