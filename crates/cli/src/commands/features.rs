//! `corsmal-feat features`: everything that a configuration can name.

use std::process::ExitCode;

use corsmal_extract::config::{SECTIONS, Section};
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
  corsmal-feat features mfcc >> my.toml      the same as a part of a configuration file
  corsmal-feat features signal               channels, sample rate, level: the keys of [signal]
  corsmal-feat features summary              statistics over frames: the keys of [summary]")]
pub struct Args {
    /// A feature to show with its parameters and their defaults, or `signal` or `summary`; without it, all
    /// features are listed.
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
    if let Some(section) = SECTIONS.iter().find(|section| section.name == name) {
        return shown(section, args.json);
    }
    let Some(feature) = find(&name) else {
        let names = kinds().into_iter().chain(SECTIONS.iter().map(|section| section.name));
        let choices = corsmal_names::choices(&name, names);
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
    println!("{}", wrapped(COEFFICIENTS, "# "));
    Ok(ExitCode::SUCCESS)
}

/// The key that every feature has.
const COEFFICIENTS: &str = "Keep some coefficients only: coefficients = [1, 13] are those from 1 to 12, counted from 0. By \
                            default all are kept.";

/// Explains a section.
fn shown(section: &Section, json: bool) -> Result<ExitCode, Failure> {
    let Section { name, about, keys } = section;
    let example = section.example();
    if json {
        let keys = keys
            .iter()
            .map(|(key, meaning)| json!({"key": key, "example": example[key], "meaning": meaning}));
        let keys: Vec<Value> = keys.collect();
        let all = json!({"name": name, "about": about, "keys": keys});
        println!("{}", serde_json::to_string_pretty(&all)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}\n\n[{name}]", wrapped(about, "# "));
    for (key, meaning) in *keys {
        println!("{}\n{key} = {}", wrapped(meaning, "# "), example[key]);
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
