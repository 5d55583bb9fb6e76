//! `corsmal-feat classifiers`: every classifier that can be trained, and its parameters.

use std::process::ExitCode;

use corsmal_models::classifiers::{ClassifierSpec, classifiers};
use corsmal_models::params::SKLEARN_NAMES;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::text_table::TextTable;

/// Arguments of `classifiers`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat classifiers
  corsmal-feat classifiers rf
  corsmal-feat train feats.npz --target type --classifier rf --set trees=500 -o type.model")]
pub struct Args {
    /// A classifier to show with its parameters; without it, all classifiers are listed.
    name: Option<String>,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Lists classifiers.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let all = classifiers();
    let Some(name) = args.name else {
        if args.json {
            let list: Vec<Value> =
                all.iter().map(|(name, about)| json!({"name": name, "about": about})).collect();
            println!("{}", serde_json::to_string_pretty(&list)?);
        } else {
            all.iter().for_each(|(name, about)| println!("{name:<10} {about}"));
            println!("\n`corsmal-feat classifiers NAME` explains the parameters of one");
        }
        return Ok(ExitCode::SUCCESS);
    };
    let spec = ClassifierSpec::named(&name)?;
    let about = all.iter().find(|(known, _)| *known == name).map_or("", |(_, about)| about);
    let values = spec.parameters();
    let sklearn =
        |key: &str| SKLEARN_NAMES.iter().find(|(_, own)| *own == key).map(|(name, _)| *name);
    if args.json {
        let parameters: Vec<Value> = spec
            .table()
            .iter()
            .map(|p| {
                json!({
                    "name": p.key, "default": values[p.key], "allowed": p.allowed,
                    "about": p.help, "scikit_learn": sklearn(p.key),
                })
            })
            .collect();
        let report = json!({"name": name, "about": about, "parameters": parameters});
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{name}: {about}\n");
    let mut table =
        TextTable::new(["parameter", "default", "may be", "meaning"]).left(&[1, 2, 3]).wrapped();
    for p in spec.table() {
        let default = match &values[p.key] {
            Value::String(text) => text.clone(),
            value => value.to_string(),
        };
        let meaning = match sklearn(p.key) {
            Some(other) => format!("{} (scikit-learn: {other})", p.help),
            None => p.help.to_string(),
        };
        table.row([p.key.to_string(), default, p.allowed.to_string(), meaning]);
    }
    println!("{}", table.text());
    println!("\n--set KEY=VALUE sets one, --tune KEY=V1,V2 chooses among several");
    Ok(ExitCode::SUCCESS)
}
