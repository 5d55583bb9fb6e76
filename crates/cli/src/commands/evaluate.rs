//! `corsmal-feat evaluate`: scores of a CORSMAL submission.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use corsmal_ccm::dataset::Annotations;
use corsmal_ccm::scores::{self, RuleSet, Scores};
use corsmal_ccm::submission::{Submission, stand_in};
use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::failure::Failure;
use crate::text_table::{TextTable, WIDTH};

#[derive(Clone, Copy, ValueEnum)]
enum Rules {
    /// The equations of the paper (T1, T2, T3, filling mass).
    Paper,
    /// The official evaluator of October 2020.
    #[value(name = "toolkit-2020-10")]
    Toolkit202010,
    /// The official evaluator of November 2021, whose scores are in the toolkit's README table.
    #[value(name = "toolkit-2021-11")]
    Toolkit202111,
    /// The current official evaluator (s1 to s10, overall, JFLT, CMD).
    Toolkit,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Json,
    Csv,
    Table,
}

/// Arguments of `evaluate`.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  corsmal-feat evaluate team.csv --annotations \
                        ccm_train_annotation.csv --rules toolkit\n\n\
                        Quirks of each rule set are described in docs/ccm.md.")]
pub struct Args {
    /// Submissions in the official 2020 or 2022 format.
    #[arg(value_name = "CSV", required_unless_present = "submission")]
    submissions: Vec<PathBuf>,
    /// The same as the positional arguments, and added after them.
    #[arg(long, num_args = 1.., value_name = "CSV")]
    submission: Vec<PathBuf>,
    /// Official annotation file.
    #[arg(long, value_name = "CSV")]
    annotations: PathBuf,
    /// Rules to score by.
    #[arg(long, value_enum, default_value = "toolkit")]
    rules: Rules,
    /// Submission that replaces unaddressed tasks, in the filling mass only.
    /// Default: the official random1.csv or random123.csv, which come with this tool; pseudo-random
    /// estimates for recordings that those files do not have.
    #[arg(long, value_name = "CSV")]
    baseline: Option<PathBuf>,
    /// Use pseudo-random estimates with this seed instead.
    #[arg(long, value_name = "N", conflicts_with = "baseline")]
    seed: Option<u64>,
    /// Score only the recordings of these containers, such as 1-9 or 3,6,9.
    #[arg(long, value_name = "LIST", value_parser = containers)]
    containers: Option<Containers>,
    /// How to print the scores.
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

/// Container numbers; a type of its own so that clap does not take it for a repeated option.
#[derive(Clone)]
struct Containers(Vec<u8>);

fn containers(text: &str) -> Result<Containers, String> {
    let fault = || format!("'{text}': expected numbers and ranges such as 1-9 or 3,6,9");
    let mut list = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let first: u8 = first.trim().parse().map_err(|_| fault())?;
        let last: u8 = last.trim().parse().map_err(|_| fault())?;
        if first > last {
            return Err(fault());
        }
        list.extend(first..=last);
    }
    Ok(Containers(list))
}

/// Prints the scores; notes go to standard error except in JSON, which holds them.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let rules = match args.rules {
        Rules::Paper => RuleSet::Paper,
        Rules::Toolkit202010 => RuleSet::Toolkit202010,
        Rules::Toolkit202111 => RuleSet::Toolkit202111,
        Rules::Toolkit => RuleSet::Toolkit,
    };
    let annotations = Annotations::read(&args.annotations)?;
    let read_baseline = args.baseline.as_deref().map(Submission::read).transpose()?;
    let mut results = Vec::new();
    for path in args.submissions.iter().chain(&args.submission) {
        let submission = Submission::read(path)?;
        let baseline = match &read_baseline {
            Some(baseline) => baseline.clone(),
            None => stand_in(&submission, &annotations, rules, args.seed)?,
        };
        let list = args.containers.as_ref().map(|c| c.0.as_slice());
        let scores = scores::evaluate(&submission, &annotations, &baseline, rules, list)?;
        results.push((submission.name(), scores));
    }
    print(&results, if args.json { Format::Json } else { args.format })?;
    Ok(ExitCode::SUCCESS)
}

fn print(results: &[(String, Scores)], format: Format) -> Result<(), Failure> {
    if !matches!(format, Format::Json) {
        print_notes(results);
    }
    // Some scores are only of submissions that address their task.
    let mut columns: Vec<&str> = Vec::new();
    for (column, _) in results.iter().flat_map(|(_, scores)| &scores.values) {
        if !columns.contains(column) {
            columns.push(column);
        }
    }
    match format {
        Format::Json => {
            let objects: Vec<_> = results.iter().map(|(name, s)| Flat(name, s)).collect();
            let text = match objects.as_slice() {
                [one] => serde_json::to_string_pretty(one)?,
                many => serde_json::to_string_pretty(many)?,
            };
            println!("{text}");
        }
        Format::Csv => {
            let mut writer = csv::Writer::from_writer(Vec::new());
            writer.write_record([&["submission"], &columns[..]].concat())?;
            for (name, scores) in results {
                let value =
                    |column: &&str| scores.get(column).map_or_else(String::new, two_decimals);
                let line = std::iter::once(name.clone()).chain(columns.iter().map(value));
                writer.write_record(line)?;
            }
            let bytes = writer.into_inner().map_err(|e| e.into_error())?;
            print!("{}", String::from_utf8_lossy(&bytes));
        }
        Format::Table => {
            let Some((name, scores)) = results.first() else { return Ok(()) };
            println!("rules {}, {} recordings, percent", scores.rules.name(), scores.rows);
            match results {
                [_] => println!("{}", single(name, scores, &columns)),
                many => {
                    println!("{}\n\n{}", table(many, &columns), legend(scores.rules, &columns));
                }
            }
        }
    }
    Ok(())
}

/// The scores of one submission, a line each with its meaning.
fn single(name: &str, scores: &Scores, columns: &[&str]) -> String {
    let mut table = TextTable::new([name, "score", "meaning"]).left(&[2]);
    for column in columns {
        let value = scores.get(column).map_or_else(String::new, two_decimals);
        let known = scores.rules.legend().iter().find(|(known, _)| known == column);
        table.row([*column, value.as_str(), known.map_or("", |(_, meaning)| *meaning)]);
    }
    table.text()
}

/// A line for each submission; scores that a terminal has no room for follow below.
fn table(results: &[(String, Scores)], columns: &[&str]) -> String {
    const COLUMN: usize = 8;
    let longest = results.iter().map(|(n, _)| n.chars().count()).max().unwrap_or(0).max(10);
    let at_once = (WIDTH.saturating_sub(longest + 1) / COLUMN).max(1);
    let parts = columns.chunks(at_once).map(|columns| {
        let mut table =
            TextTable::new(std::iter::once("submission").chain(columns.iter().copied()));
        for (name, scores) in results {
            let value = |column: &&str| scores.get(column).map_or_else(String::new, two_decimals);
            table.row(std::iter::once(name.clone()).chain(columns.iter().map(value)));
        }
        table.text()
    });
    parts.collect::<Vec<_>>().join("\n\n")
}

/// Each note once, with the submissions that it is about.
fn print_notes(results: &[(String, Scores)]) {
    const NAMED: usize = 4;
    let mut notes: Vec<(&str, Vec<&str>)> = Vec::new();
    for (name, scores) in results {
        for note in &scores.notes {
            match notes.iter_mut().find(|(text, _)| text == note) {
                Some((_, names)) => names.push(name),
                None => notes.push((note, vec![name])),
            }
        }
    }
    for (note, names) in notes {
        let more = match names.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let names = names.into_iter().take(NAMED).collect::<Vec<_>>().join(", ");
        eprintln!("note: {names}{more}: {note}");
    }
}

/// What the columns mean, several to a line of a terminal.
fn legend(rules: RuleSet, columns: &[&str]) -> String {
    let known = rules.legend().iter().filter(|(name, _)| columns.contains(name));
    let mut lines = vec![String::new()];
    for (name, meaning) in known {
        let entry = format!("{name} {meaning}");
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(&entry),
            Some(line) if line.chars().count() + entry.chars().count() + 3 <= 80 => {
                line.push_str(" \u{b7} ");
                line.push_str(&entry);
            }
            _ => lines.push(entry),
        }
    }
    lines.join("\n")
}

fn two_decimals(value: f64) -> String {
    format!("{value:.2}")
}

/// A result as one flat object, keys in the order of the scores.
struct Flat<'a>(&'a str, &'a Scores);

impl Serialize for Flat<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(name, scores) = self;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("submission", name)?;
        map.serialize_entry("rules", scores.rules.name())?;
        map.serialize_entry("recordings", &scores.rows)?;
        for (name, value) in &scores.values {
            map.serialize_entry(name, value)?;
        }
        map.serialize_entry("notes", &scores.notes)?;
        map.end()
    }
}
