//! `corsmal-feat features`: every feature that a configuration can name.

use std::process::ExitCode;

use corsmal_extract::features::{Entry, find, kinds, registry};
use serde_json::{Value, json};

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
    /// A feature to show with its parameters and their defaults; without it, all features are listed.
    name: Option<String>,
    /// Print everything as JSON.
    #[arg(long)]
    json: bool,
}

/// Lists features, or explains one as a table of a configuration file.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Some(name) = args.name else {
        if args.json {
            let all = registry().into_iter().map(described).collect::<Vec<_>>();
            println!("{}", serde_json::to_string_pretty(&all)?);
            return Ok(ExitCode::SUCCESS);
        }
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
    if args.json {
        println!("{}", serde_json::to_string_pretty(&described(feature))?);
        return Ok(ExitCode::SUCCESS);
    }
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

/// A feature with its keys, their defaults and meanings.
fn described(feature: &Entry) -> Value {
    let defaults = feature.defaults();
    let keys = feature
        .keys()
        .map(|key| json!({"key": key, "default": defaults[key], "meaning": feature.explain(key)}));
    json!({
        "name": feature.kind(),
        "about": feature.about(),
        "python": feature.python(),
        "keys": keys.collect::<Vec<_>>(),
    })
}
