//! Inspection of an output: contents, configuration, outcomes.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use corsmal_extract::projection::Projection;
use corsmal_files::feature_file::{FeatureFile, FeatureTable};
use corsmal_files::layout;
use corsmal_files::npz::NpzFile;
use corsmal_files::outcome::Outcome;
use corsmal_files::parquet::ParquetFile;
use corsmal_files::partition;
use corsmal_files::provenance::Provenance;
use corsmal_files::table::Table;
use serde::Serialize;
use serde_json::Value;

use super::extracted::{Recordings, shapes};
use super::refusal::{corrupt, to_json};
use crate::configuration::nearest;
use crate::failure::Failure;
use crate::paragraphs::{WIDTH, wrapped};
use crate::plural::plural;
use crate::progress::{counts, failure_line};

/// Members shown as text; JSON has all.
const SHOWN: usize = 20;
/// Where values begin after `  label       `.
const LABELS: usize = 14;

/// Everything that is printed; its JSON form is the output of `--json`.
#[derive(Serialize)]
struct Contents {
    path: String,
    format: &'static str,
    members: Vec<Member>,
    /// What only outputs of `extract` have.
    #[serde(flatten)]
    run: Option<Run>,
    /// What only files of `pca` have.
    #[serde(skip_serializing_if = "Option::is_none")]
    projection: Option<Projected>,
}

/// What a projection does.
#[derive(Serialize)]
struct Projected {
    n_inputs: usize,
    n_components: usize,
    /// Of the features that it was fitted on.
    config_hash: String,
    rows: usize,
}

/// An array of an archive or a column of a table.
#[derive(Serialize)]
struct Member {
    name: String,
    #[serde(rename = "type")]
    kind: String,
    shape: Vec<u64>,
}

/// How an output was made and what became of its inputs.
#[derive(Serialize)]
struct Run {
    meta: Provenance,
    config: Value,
    statuses: BTreeMap<&'static str, usize>,
    /// Of a summary; 0 where there are frames.
    n_features: usize,
    #[serde(flatten)]
    recordings: Recordings,
    failed: Vec<Outcome>,
}

type Failed = Box<dyn std::error::Error>;

/// A feature file: all of it where it is one of ours, else its members.
fn read(path: &Path) -> Result<Contents, Failed> {
    if path.is_dir() {
        let FeatureTable { table, provenance, .. } = partition::open(path)?.0;
        let features = provenance.features();
        let frames = if table.feature_names().is_empty() { features } else { Vec::new() };
        return of_table(path, "parquet files", (table, provenance), &frames);
    }
    match FeatureFile::open(path)? {
        FeatureFile::Npz(file) => npz(file),
        FeatureFile::Npy(file) => {
            let member = Member {
                name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
                kind: file.header().dtype.to_string(),
                shape: file.header().shape.clone(),
            };
            let (path, members) = (path.display().to_string(), vec![member]);
            Ok(Contents { path, format: "npy", members, run: None, projection: None })
        }
        FeatureFile::Parquet(file) => parquet(&file),
    }
}

fn npz(mut file: NpzFile) -> Result<Contents, Failed> {
    let names = file.names().to_vec();
    let mut members = Vec::with_capacity(names.len());
    for name in names {
        let header = file.header(&name)?;
        members.push(Member { name, kind: header.dtype.to_string(), shape: header.shape });
    }
    if members.is_empty() {
        return Err("a zip archive without .npy members".into());
    }
    let run = match layout::is_ours(&file) {
        true => Some(Run::new(layout::read_table(&mut file)?)?),
        false => None,
    };
    let projection = Projection::load(file.path()).ok().map(|p| Projected {
        n_inputs: p.n_inputs(),
        n_components: p.n_components(),
        config_hash: p.fitted_on().0.to_owned(),
        rows: p.fitted_on().1,
    });
    Ok(Contents {
        path: file.path().display().to_string(),
        format: "npz",
        members,
        run,
        projection,
    })
}

/// An output of ours.
fn parquet(file: &ParquetFile) -> Result<Contents, Failed> {
    if !file.is_ours() {
        return foreign_parquet(file);
    }
    of_table(file.path(), "parquet", file.table()?, &file.frame_features())
}

/// A table of ours, with the columns of frames beside it.
fn of_table(
    path: &Path,
    format: &'static str,
    found: (Table, Provenance),
    frames: &[String],
) -> Result<Contents, Failed> {
    let table = &found.0;
    let column = |name: &str, kind: &str| Member {
        name: name.to_owned(),
        kind: kind.to_owned(),
        shape: vec![table.ids().len() as u64],
    };
    let labels = table.labels().map(|(name, _)| column(name, "text"));
    let features = table.feature_names().iter().map(|name| column(name, "float32"));
    let frames = frames.iter().map(|name| column(name, "lists"));
    let columns = std::iter::once(column("id", "text")).chain(labels);
    let members = columns.chain(features).chain(frames).collect();
    let path = path.display().to_string();
    let run = Some(Run::new(found)?);
    Ok(Contents { path, format, members, run, projection: None })
}

/// A table of another tool.
fn foreign_parquet(file: &ParquetFile) -> Result<Contents, Failed> {
    let table = file.numbers()?;
    let rows = table.values.nrows() as u64;
    let column = |name: &str, kind: &str| Member {
        name: name.to_owned(),
        kind: kind.to_owned(),
        shape: vec![rows],
    };
    let ids = table.ids.iter().map(|_| column("id", "text"));
    let texts = table.texts.iter().map(|(name, _)| column(name, "text"));
    let numbers = table.names.iter().zip(&table.types).map(|(name, kind)| column(name, kind));
    let others = table.skipped.iter().map(|name| column(name, "other"));
    let members = ids.chain(texts).chain(numbers).chain(others).collect();
    let path = file.path().display().to_string();
    Ok(Contents { path, format: "parquet", members, run: None, projection: None })
}

/// Prints what is found in a file.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    match read(path) {
        Ok(report) => {
            print!("{}", if json { to_json(&report)? } else { report.text() });
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => corrupt(path, &error, json),
    }
}

impl Run {
    fn new((table, meta): (Table, Provenance)) -> Result<Self, serde_json::Error> {
        let config = serde_json::from_str(&meta.config)?;
        let failed = table.outcomes().iter().filter(|o| !o.status.has_features());
        let (statuses, failed) = (counts(table.outcomes()), failed.cloned().collect());
        let recordings = Recordings::of(&table);
        let n_features = table.feature_names().len();
        Ok(Self { meta, config, statuses, n_features, recordings, failed })
    }

    /// Names of its features.
    fn features(&self) -> Vec<&str> {
        let features = self.config["features"].as_object().into_iter().flatten();
        features.map(|(name, _)| name.as_str()).collect()
    }

    /// Outcomes, recordings, then what is not usual about the configuration.
    fn text(&self, lines: &mut Vec<String>) {
        self.recordings.text(lines);
        if !self.failed.is_empty() {
            lines.push("\n  without features".into());
            lines.extend(self.failed.iter().map(|o| format!("    {}", failure_line(o))));
        }
        let (base, changes) = nearest(&self.config);
        lines.push(format!("\n  configuration {}", self.meta.config_hash));
        let others = if changes.is_empty() { "" } else { ", except for (its values in brackets)" };
        lines.push(format!("  is {base}{others}"));
        lines.extend(changes.iter().map(|change| format!("    {change}")));
    }
}

/// A line that a terminal of eighty columns shows whole: what is beyond goes below, further in.
fn folded(line: &str) -> String {
    if line.chars().count() <= WIDTH {
        return line.to_owned();
    }
    let indent = line.len() - line.trim_start_matches([' ', '\n']).len();
    // `  label       name: values` goes on below the values.
    let (head, deeper) = match line.get(..LABELS) {
        Some(head) if head[indent.min(LABELS)..].ends_with("  ") => (LABELS, LABELS),
        _ => (indent, indent + 2),
    };
    let rest = wrapped(&line[head..], &" ".repeat(deeper));
    format!("{}{}", &line[..head], rest.trim_start())
}

impl Contents {
    fn text(&self) -> String {
        let mut lines = vec![self.path.clone()];
        let arrays = format!(
            "{} · {}",
            self.format,
            plural(
                self.members.len(),
                if self.format.starts_with("parquet") { "column" } else { "member" }
            )
        );
        lines.push(match &self.run {
            None => format!("  {arrays}"),
            Some(run) => {
                let statuses: Vec<_> =
                    run.statuses.iter().map(|(status, n)| format!("{n} {status}")).collect();
                let inputs = plural(run.statuses.values().sum::<usize>(), "input");
                let Provenance { tool_version, shard, .. } = &run.meta;
                format!(
                    "  {arrays} · corsmal-feat {tool_version} · shard {shard} · {inputs}: {}",
                    statuses.join(", ")
                )
            }
        });
        lines.push(String::new());
        if let Some(run) = &self.run {
            let names: Vec<&str> = run.features();
            let arrays = self.members.iter().map(|m| (m.name.as_str(), m.shape.as_slice()));
            lines.extend(shapes(&names, arrays, run.n_features));
            run.text(&mut lines);
        } else {
            let width = self.members.iter().map(|m| m.name.chars().count()).max().unwrap_or(0);
            let row = |m: &Member| {
                let shape: Vec<_> = m.shape.iter().map(u64::to_string).collect();
                let Member { name, kind, .. } = m;
                format!("  {name:width$}  {kind:8}  {}", shape.join(" × ")).trim_end().to_owned()
            };
            lines.extend(self.members.iter().take(SHOWN).map(row));
            if self.members.len() > SHOWN {
                let more = self.members.len() - SHOWN;
                lines.push(format!("  … and {more} more (--json lists all)"));
            }
        }
        if let Some(Projected { n_inputs, n_components, config_hash, rows }) = &self.projection {
            lines.push(format!(
                "\n  projection of {n_inputs} features to {n_components} components, fitted on {}\n  \
                 of configuration {config_hash} (extract --project)",
                plural(*rows, "row")
            ));
        }
        let lines: Vec<String> = lines.iter().map(|line| folded(line)).collect();
        lines.join("\n") + "\n"
    }
}
