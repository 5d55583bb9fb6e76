//! `corsmal-feat nets`: the networks of the paper, listed and explained.

use std::process::ExitCode;

use crate::failure::Failure;

/// Arguments of `nets`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat nets
  corsmal-feat nets m4-type

Recipes are those of the published code with its defects corrected; docs/networks.md says where
paper, code and this tool differ.")]
pub struct Args {
    /// Show the layers and the recipe of one network.
    #[arg(value_name = "NAME")]
    name: Option<String>,
    /// Print everything as JSON.
    #[arg(long)]
    json: bool,
}

/// Lists, or explains one.
#[cfg(feature = "nets")]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    use corsmal_nets::networks::{self, NETWORKS};
    use serde_json::json;

    let Some(name) = &args.name else {
        if args.json {
            let all: Vec<_> =
                NETWORKS.iter().map(|d| json!({"name": d.name, "about": d.about})).collect();
            println!("{}", serde_json::to_string_pretty(&all)?);
            return Ok(ExitCode::SUCCESS);
        }
        for definition in NETWORKS {
            println!("{:16} {}", definition.name, definition.about);
        }
        return Ok(ExitCode::SUCCESS);
    };
    let definition = networks::named(name)?;
    let network = definition.build(None, 0)?;
    let (layers, parameters) = (network.describe(), network.parameters().count());
    if args.json {
        let layers: Vec<_> =
            layers.iter().map(|(layer, shape)| json!({"layer": layer, "shape": shape})).collect();
        let all = json!({
            "name": definition.name,
            "about": definition.about,
            "parameters": parameters,
            "layers": layers,
            "recipe": definition.recipe,
        });
        println!("{}", serde_json::to_string_pretty(&all)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}: {}\n{parameters} parameters\n", definition.name, definition.about);
    let width = layers.iter().map(|(layer, _)| layer.chars().count()).max().unwrap_or(0);
    for (layer, shape) in &layers {
        println!("{layer:width$}  {shape}");
    }
    println!("\nrecipe");
    if let serde_json::Value::Object(recipe) = serde_json::to_value(definition.recipe)? {
        for (key, value) in recipe {
            println!("  {key} = {value}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Says how to get them.
#[cfg(not(feature = "nets"))]
pub fn run(_: Args) -> Result<ExitCode, Failure> {
    Err(absent())
}

/// How to get networks.
#[cfg(not(feature = "nets"))]
pub fn absent() -> Failure {
    Failure::new(
        "this build has no networks; `cargo install --path crates/cli --features nets` makes one \
         that has them, and so has the Python package",
    )
}
