//! `corsmal-feat nets`: the networks, listed and explained.

use std::io::Read;
use std::path::Path;
use std::process::ExitCode;

use crate::failure::Failure;

/// Arguments of `nets`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat nets
  corsmal-feat nets m4-type
  corsmal-feat nets m4

`corsmal-feat benchmark --methods` runs systems, m1 to m6; `train --net` trains the networks that
they consist of, and our own: `mel-cnn` on recordings of any kind, `attention-gru` on embeddings.
Recipes are those of the published code with its defects corrected; docs/networks.md says where
paper, code and this tool differ.")]
pub struct Args {
    /// Show the layers and the recipe of one network, or the parts of one system.
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
    use corsmal_systems::{self as systems, SYSTEMS};
    use serde_json::json;

    let Some(name) = &args.name else {
        if args.json {
            let named = |name, about| json!({ "name": name, "about": about });
            let networks: Vec<_> = NETWORKS.iter().map(|d| named(d.name, d.about)).collect();
            let systems: Vec<_> = SYSTEMS.iter().map(|s| named(s.name, s.about)).collect();
            let all = json!({ "systems": systems, "networks": networks });
            println!("{}", serde_json::to_string_pretty(&all)?);
            return Ok(ExitCode::SUCCESS);
        }
        println!("systems (benchmark --methods)");
        for system in SYSTEMS {
            println!("  {:16} {}", system.name, system.about);
        }
        println!("\nnetworks (train --net)");
        for definition in NETWORKS {
            println!("  {:16} {}", definition.name, definition.about);
        }
        return Ok(ExitCode::SUCCESS);
    };
    // m1 is a system and the network that it is made of: what trains it says more.
    let is_network = networks::named(name).is_ok();
    if let Some(system) = systems::named(name).ok().filter(|_| !is_network) {
        return explain(system, args.json);
    }
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
            "takes": definition.takes,
            "preset": definition.front_end.map(|f| f.preset),
            "recipe": definition.recipe,
            "paper": definition.paper.iter().copied().collect::<std::collections::BTreeMap<_, _>>(),
        });
        println!("{}", serde_json::to_string_pretty(&all)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}: {}\n{parameters} parameters", definition.name, definition.about);
    match definition.front_end {
        Some(front_end) => {
            println!(
                "takes {}, from recordings by preset {}\n",
                definition.takes, front_end.preset
            );
        }
        None => println!("takes {}\n", definition.takes),
    }
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
    for (number, (key, value)) in definition.paper.iter().enumerate() {
        println!("{}  {key} = {value}", if number == 0 { "\nrecipe=paper\n" } else { "" });
    }
    Ok(ExitCode::SUCCESS)
}

/// What a system is made of, and what of it is not there.
#[cfg(feature = "nets")]
fn explain(system: &corsmal_systems::Definition, as_json: bool) -> Result<ExitCode, Failure> {
    let corsmal_systems::Definition { name, about, networks, limits, .. } = system;
    if as_json {
        let all = serde_json::json!({
            "name": name,
            "about": about,
            "networks": networks,
            "limits": limits,
        });
        println!("{}", serde_json::to_string_pretty(&all)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{name}: {about}\n\nnetworks  {}", networks.join(", "));
    for limit in *limits {
        println!("\n{limit}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether a file begins as a trained network does: the length of a header, and the header's brace.
pub fn is_model(path: &Path) -> bool {
    let mut start = [0; 9];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start[8] == b'{'
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
         that has them; the Python package has them, too",
    )
}
