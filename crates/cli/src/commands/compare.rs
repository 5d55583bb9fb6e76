//! `corsmal-feat compare`: how two feature files differ, and why they probably do.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_compare::{
    Comparison, Criteria, FeatureReport, PairedBy, Setting, TextDifference, TextReport, Tolerance,
    is_complex,
};
use corsmal_files::quote::quoted;
use serde_json::Value;

use crate::failure::Failure;
use crate::plural::plural;

/// Exit code when the files differ by more than the tolerance.
const DIFFER: u8 = 1;
/// Names shown of a long list; JSON has all.
const SHOWN: usize = 10;

/// Arguments of `compare`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat compare feats.npz librosa.npz --map clip=logmel
  corsmal-feat compare old.npz new.npz --atol 1e-4 --rtol 1e-5 --json

Files may be outputs of `extract`, any .npz or .npy with numeric arrays, or a Parquet table.
Arrays are paired by name, outputs of `extract` by recording (id, else file name, else content) and
feature, tables by id and column, rows of other arrays by an array `id` or `ids` in both files, else by
number; if each file has only one array, they need no name. The last axis is
frames, the one before coefficients, the one before that channels (librosa's order). Only two
arrays are in memory at a time. Labels, statuses and texts that both files have, and integers
beyond 2^53, are compared exactly.

Likely causes are derived from the values, each with its evidence: offsets, factors, clamps,
padding, order of axes and channels, and so on. docs/parity.md explains them.

Exit codes: 0 all within the tolerance, 1 differences (or arrays in only one file), 2 could
not run.")]
pub struct Args {
    /// The first file.
    a: PathBuf,
    /// The second file.
    b: PathBuf,
    /// Values are equal when they differ by at most this share of the largest magnitude of their arrays;
    /// in tables, of their columns, the coefficients of a vector together.
    #[arg(long, value_name = "SHARE", default_value = "1e-5", value_parser = number)]
    tolerance: f64,
    /// Values are equal when they differ by at most ATOL + RTOL * |b|, as numpy.allclose with equal_nan.
    #[arg(long, value_name = "ATOL", conflicts_with = "tolerance", value_parser = number)]
    atol: Option<f64>,
    /// The relative part of --atol.
    #[arg(long, value_name = "RTOL", conflicts_with = "tolerance", value_parser = number)]
    rtol: Option<f64>,
    /// Compare array A of the first file with array B of the second; may be repeated.
    #[arg(long, value_name = "A=B", value_parser = pair)]
    map: Vec<(String, String)>,
    /// Print everything as JSON.
    #[arg(long)]
    json: bool,
}

fn number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("expected a number of at least 0".into()),
    }
}

fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((a, b)) if !a.is_empty() && !b.is_empty() => Ok((a.into(), b.into())),
        _ => Err("expected A=B, two names of arrays".into()),
    }
}

/// Compares two files.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let tolerance = match (args.atol, args.rtol) {
        (None, None) => Tolerance::OfLargest(args.tolerance),
        (atol, rtol) => Tolerance::Each { atol: atol.unwrap_or(0.0), rtol: rtol.unwrap_or(0.0) },
    };
    let report =
        corsmal_compare::compare(&args.a, &args.b, &Criteria { tolerance, map: args.map })?;
    let text = match args.json {
        true => serde_json::to_string_pretty(&report)? + "\n",
        false => text(&report),
    };
    print!("{text}");
    for refused in &report.refused {
        eprintln!("not compared: {} ({})", refused.array, refused.reason);
    }
    Ok(if report.within { ExitCode::SUCCESS } else { ExitCode::from(DIFFER) })
}

fn text(report: &Comparison) -> String {
    let mut lines = Vec::new();
    for (side, file) in [("a", &report.a), ("b", &report.b)] {
        let version = file.tool_version.as_ref().map(|v| format!(", corsmal-feat {v}"));
        lines.push(format!(
            "{side}  {} ({}{})",
            file.path,
            file.format,
            version.unwrap_or_default()
        ));
    }
    match report.paired_by {
        PairedBy::Id => {}
        PairedBy::FileName => {
            lines.push("\nno id in common: recordings are paired by file name".into());
        }
        PairedBy::Content => {
            lines.push("\nno id or file name in common: recordings are paired by content".into());
        }
    }
    match report.paired_rows {
        None => {}
        Some(0) => lines.push("\nno id in common: rows are paired by number".into()),
        Some(rows) => {
            let ids = if report.paired_by == PairedBy::Id { " by their ids" } else { "" };
            let rows = plural(rows, "row");
            lines.push(format!("\n{rows} paired{ids}, in every array with one for each id"));
        }
    }
    settings(report, &mut lines);
    lines.push(String::new());
    lines.extend(table(&report.features));
    for feature in &report.features {
        details(feature, &mut lines);
    }
    for text in report.texts.iter().filter(|text| text.differing > 0) {
        let TextReport { name, values, differing, first } = text;
        lines.push(format!("\n{name}\n  {differing} of {values} values differ"));
        if let Some(TextDifference { place, a, b }) = first {
            lines.push(format!("  first in {}: {} and {}", quoted(place), quoted(a), quoted(b)));
        }
    }
    for (side, names) in [("a", &report.only_a), ("b", &report.only_b)] {
        if !names.is_empty() {
            lines.push(format!("\nonly in {side}: {}", listing(names)));
        }
    }
    let of_texts = report.texts.iter().filter(|text| text.differing > 0).count();
    let differing = report.features.iter().filter(|f| f.differing > 0).count();
    lines.push(match (report.within, differing) {
        (true, _) => "\nequal within the tolerance".into(),
        (false, 0) if of_texts > 0 => {
            "\nfeatures are equal within the tolerance; labels, statuses or other texts differ"
                .into()
        }
        (false, 0) => {
            "\nwhat both files have is equal within the tolerance; the rest is in only one of them"
                .into()
        }
        (false, n) => {
            format!("\n{n} of {} differ by more than the tolerance", report.features.len())
        }
    });
    lines.join("\n") + "\n"
}

fn settings(report: &Comparison, lines: &mut Vec<String>) {
    let Some(settings) = &report.settings else { return };
    let same = settings.hash_a == settings.hash_b;
    lines.push(format!(
        "\nconfiguration {}, {} inputs",
        if same { "the same" } else { "different" },
        if settings.same_inputs { "the same" } else { "other" }
    ));
    let contents = &settings.contents;
    if let Some(first) = &contents.first {
        lines.push(format!(
            "  {} of {} paired recordings differ in content; the first is {}",
            contents.differing,
            contents.values,
            quoted(&first.place)
        ));
    }
    let shown = |value: &Option<Value>| match value {
        Some(value) => value.to_string(),
        None => "absent".into(),
    };
    let width = settings.differences.iter().map(|s| s.key.len()).max().unwrap_or(0);
    let row = |s: &Setting| format!("  {:width$}  {} | {}", s.key, shown(&s.a), shown(&s.b));
    lines.extend(settings.differences.iter().map(row));
}

/// Rounded down: only where all are equal it is 100.
fn percent(part: u64, of: u64) -> String {
    let tenths = (1000.0 * part as f64 / of.max(1) as f64).floor();
    format!("{:.1} %", tenths / 10.0)
}

fn table(features: &[FeatureReport]) -> Vec<String> {
    let heads =
        ["feature", "arrays", "differ", "equal", "max abs", "max rel", "rms", "correlation"];
    let mut rows = vec![heads.map(str::to_string)];
    rows.extend(features.iter().map(|f| {
        let d = &f.difference;
        let number = |value: f64| if value == 0.0 { "0".into() } else { format!("{value:.3e}") };
        let compared = d.values > 0;
        let some = |text: String| if compared { text } else { "-".into() };
        [
            f.feature.clone(),
            f.arrays.to_string(),
            f.differing.to_string(),
            some(percent(d.equal, d.values)),
            some(number(d.max_absolute)),
            some(number(d.max_relative)),
            some(number(d.rms)),
            d.correlation.map_or("-".into(), |r| format!("{r:.6}")),
        ]
    }));
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..heads.len()).map(width).collect();
    let line = |row: &[String; 8]| {
        let cells = row.iter().zip(&widths).enumerate().map(|(k, (cell, &width))| match k {
            0 => format!("{cell:width$}"),
            _ => format!("{cell:>width$}"),
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_string()
    };
    rows.iter().map(line).collect()
}

fn details(feature: &FeatureReport, lines: &mut Vec<String>) {
    let d = &feature.difference;
    if feature.shapes.is_empty() && d.equal == d.values {
        return;
    }
    lines.push(format!("\n{}", feature.feature));
    let [a, b] = &feature.dtypes;
    if a != b {
        lines.push(format!("  types {a} and {b}"));
    }
    if let Some(first) = feature.shapes.first() {
        let count = feature.shapes.len();
        lines.push(format!(
            "  shapes {:?} and {:?} in {} ({count} such)",
            first.a, first.b, first.array
        ));
    }
    if let Some(e) = &d.largest {
        let place =
            if e.position.is_empty() { String::new() } else { format!(" at {}", e.position) };
        lines.push(format!(
            "  largest difference{} {:.6e}: {} and {} in {}{place}",
            if e.is_beyond { " beyond the tolerance" } else { "" },
            e.value,
            e.a,
            e.b,
            e.array
        ));
    }
    if d.one_sided > 0 {
        lines.push(format!("  {} values are finite, or a number, on only one side", d.one_sided));
    }
    if feature.causes.is_empty() {
        let unknown = match feature.dtypes.iter().any(|dtype| is_complex(dtype)) {
            true => "  complex values: causes are looked for in real ones only",
            false => "  cause unknown",
        };
        lines.push(unknown.into());
    }
    for found in &feature.causes {
        lines.push(format!("  likely cause: {}", found.cause.cause));
        let whole =
            ["the table", "the recordings", "the configurations"].contains(&found.array.as_str());
        let arrays = if feature.arrays > 1 && !whole {
            format!(" ({}; {} of {} arrays)", found.array, found.arrays, feature.arrays)
        } else {
            String::new()
        };
        lines.push(format!("    {}{arrays}", found.cause.evidence));
    }
}

fn listing(names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().take(SHOWN).map(String::as_str).collect();
    match names.len().checked_sub(SHOWN + 1) {
        None => shown.join(", "),
        Some(more) => format!("{} and {} more (--json lists all)", shown.join(", "), more + 1),
    }
}
