//! Inspection of what a run needs and leaves: configurations, ledgers, pages.

use std::path::Path;
use std::process::ExitCode;

use corsmal_extract::config::Config;
use corsmal_extract::ledger;
use serde_json::json;

use super::refusal::{Refusal, corrupt, to_json};
use crate::configuration::nearest;
use crate::failure::Failure;
use crate::plural::plural;
use crate::progress::{counts, failure_line};

/// Prints which features a configuration asks for, and how it differs from a preset.
pub fn configuration(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    let config = match Config::load(path, &[]) {
        Ok(config) => config,
        Err(error) => {
            let reason = error.to_string();
            return Refusal { path: &name, status: "invalid", byte: None, reason: &reason }
                .print(json);
        }
    };
    let value = config.to_value();
    if json {
        let contents = json!({
            "path": name, "kind": "configuration", "config_hash": config.hash(), "config": value,
        });
        print!("{}", to_json(&contents)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{name}\n  configuration · {}\n", config.hash());
    let features = value["features"].as_object().into_iter().flatten();
    let features: Vec<&str> = features.map(|(name, _)| name.as_str()).collect();
    println!("  features    {}", features.join(", "));
    let (base, changes) = nearest(&value);
    match changes.is_empty() {
        true => println!("  is {base}"),
        false => println!("  differs from {base} in"),
    }
    changes.iter().for_each(|change| println!("    {change}"));
    println!("\n  corsmal-feat extract --config {name} RECORDINGS");
    Ok(ExitCode::SUCCESS)
}

/// Prints how far an interrupted run came.
pub fn ledger(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    let (header, outcomes) = match ledger::look(path) {
        Ok(found) => found,
        Err(error) => return corrupt(path, &error, json),
    };
    let statuses = counts(&outcomes);
    let failed: Vec<_> = outcomes.iter().filter(|o| !o.status.has_features()).collect();
    if json {
        let contents = json!({
            "path": name, "kind": "ledger", "header": header, "done": outcomes.len(),
            "statuses": statuses, "failed": failed,
        });
        print!("{}", to_json(&contents)?);
        return Ok(ExitCode::SUCCESS);
    }
    let (version, shard, format) = (&header.tool_version, &header.shard, &header.format);
    println!(
        "{name}\n  ledger of an unfinished run · corsmal-feat {version} · shard {shard} · {format}\n"
    );
    let told: Vec<String> = statuses.iter().map(|(status, n)| format!("{n} {status}")).collect();
    println!("  done           {}: {}", plural(outcomes.len(), "input"), told.join(", "));
    println!("  configuration  {}", header.config_hash);
    println!("  inputs         {}", header.inputs_hash);
    failed.iter().for_each(|outcome| println!("    {}", failure_line(outcome)));
    println!("\n  to continue it, run the same command again with --resume");
    Ok(ExitCode::SUCCESS)
}

/// Says what a page is: other programs show it.
pub fn page(path: &Path, format: &str, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    let bytes = std::fs::metadata(path).map_err(|e| Failure::new(format!("{name}: {e}")))?.len();
    if json {
        let contents = json!({ "path": name, "kind": "page", "format": format, "bytes": bytes });
        print!("{}", to_json(&contents)?);
    } else {
        println!(
            "{name}\n  {format} · {} · a page or figure; open it in a browser or viewer",
            plural(bytes, "byte")
        );
    }
    Ok(ExitCode::SUCCESS)
}
