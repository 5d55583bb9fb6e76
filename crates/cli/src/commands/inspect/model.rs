//! Inspection of trained classifiers.

use std::path::Path;
use std::process::ExitCode;

use corsmal_models::model_file::{Model, ModelHeader};
use serde_json::Value;

use super::refusal::{corrupt, to_json};
use crate::failure::Failure;
use crate::plural::plural;

/// Prints what a model was trained on and what it predicts.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    match Model::load(path) {
        Ok(model) => {
            let header = model.header();
            print!("{}", if json { to_json(header)? } else { model_text(&name, &model)? });
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => corrupt(path, &error, json),
    }
}

fn model_text(name: &str, model: &Model) -> Result<String, Failure> {
    let header = model.header();
    let document = serde_json::to_value(header)?;
    let mut out = format!(
        "{name}\n  model · corsmal-feat {} · predicts {} from {}\n",
        header.tool_version,
        header.target,
        plural(model.n_features(), "feature")
    );
    let classes: Vec<&str> = match &document["labels"] {
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
        Value::Object(fields) => fields
            .values()
            .filter_map(Value::as_array)
            .flatten()
            .filter_map(Value::as_str)
            .collect(),
        _ => Vec::new(),
    };
    out.push_str(&format!("\n  classes        {}\n", classes.join(", ")));
    out.push_str(&format!("  recordings     {}\n", recordings(header)));
    for (key, value) in
        [("pipeline", &document["pipeline"]), ("trained on", &document["provenance"])]
    {
        let mut lines = Vec::new();
        flatten("", value, &mut lines);
        for (i, line) in lines.iter().enumerate() {
            out.push_str(&format!("  {:13}  {line}\n", if i == 0 { key } else { "" }));
        }
    }
    if !header.feature_config_hash.is_empty() {
        out.push_str(&format!("  configuration  {}\n", header.feature_config_hash));
    }
    let of = if header.feature_config.is_null() { "--features FILE" } else { "RECORDINGS" };
    out.push_str(&format!("\n  corsmal-feat classify --model {name} {of}\n"));
    Ok(out)
}

/// The recordings that the model was trained on: what `classify` refuses others by.
fn recordings(header: &ModelHeader) -> String {
    if header.feature_config.is_null() {
        return "unknown: trained on a table of another program, or saved in Python without \
                features=; classify takes such tables"
            .into();
    }
    let Some(trained) = &header.trained_on else {
        return "sample rates and channels not recorded: classify needs --any-rate".into();
    };
    let listed = |values: &[u32]| values.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let ending = if trained.channels == [1] { "" } else { "s" };
    let lengths = trained.seconds.map(|seconds| format!(", {seconds}")).unwrap_or_default();
    let (rates, channels) = (listed(&trained.sample_rates), listed(&trained.channels));
    format!("{rates} Hz, {channels} channel{ending}{lengths}")
}

/// One line `key = value` for every value.
pub(super) fn flatten(key: &str, value: &Value, lines: &mut Vec<String>) {
    match value {
        Value::Object(table) => {
            for (name, value) in table {
                let dot = if key.is_empty() { "" } else { "." };
                flatten(&format!("{key}{dot}{name}"), value, lines);
            }
        }
        Value::Null => {}
        value => lines.push(format!("{key} = {value}")),
    }
}
