//! What an output of `extract` says of its recordings, and how its configuration differs from the
//! preset that is nearest.

use std::collections::BTreeMap;

use corsmal_extract::config::{Config, PRESETS};
use corsmal_files::layout;
use corsmal_files::outcome::Outcome;
use corsmal_files::table::Table;
use serde::Serialize;
use serde_json::Value;

/// Different values that a line names.
const NAMED: usize = 6;

/// Recordings of an output.
#[derive(Serialize)]
pub struct Recordings {
    /// Sample rate in Hz: recordings.
    rates: BTreeMap<u32, usize>,
    /// Channels: recordings.
    channels: BTreeMap<u32, usize>,
    /// Shortest, longest and all of them in seconds.
    seconds: Option<[f64; 3]>,
    /// Label column: value: recordings.
    labels: BTreeMap<String, BTreeMap<String, usize>>,
}

impl Recordings {
    /// Counts what the outcomes and labels of a table say.
    pub fn of(table: &Table) -> Self {
        let outcomes = table.outcomes().iter().filter(|outcome| outcome.status.has_features());
        let seconds: Vec<f64> = outcomes.clone().filter_map(seconds).collect();
        let sum: f64 = seconds.iter().sum();
        let shortest = seconds.iter().copied().reduce(f64::min);
        let longest = seconds.iter().copied().reduce(f64::max);
        let labels = table.labels();
        Self {
            rates: counted(outcomes.clone().filter_map(|outcome| outcome.sample_rate)),
            channels: counted(outcomes.filter_map(|outcome| outcome.channels)),
            seconds: shortest.zip(longest).map(|(shortest, longest)| [shortest, longest, sum]),
            labels: labels
                .map(|(name, values)| (name.to_string(), counted(values.iter().cloned())))
                .collect(),
        }
    }

    /// A line for each kind of fact.
    pub fn text(&self, lines: &mut Vec<String>) {
        let several = |n: usize| if n > 1 { "  (mixed)" } else { "" };
        if !self.rates.is_empty() {
            let rates = listed(&self.rates, |rate| format!("{rate} Hz"));
            lines.push(format!("  rates       {rates}{}", several(self.rates.len())));
            let channels = listed(&self.channels, u32::to_string);
            lines.push(format!("  channels    {channels}{}", several(self.channels.len())));
        }
        if let Some([shortest, longest, sum]) = self.seconds {
            let range = match format!("{shortest:.2}") == format!("{longest:.2}") {
                true => format!("{shortest:.2} s each"),
                false => format!("{shortest:.2} to {longest:.2} s"),
            };
            lines.push(format!("  durations   {range}, {sum:.2} s in all"));
        }
        for (name, values) in &self.labels {
            let shown = match values.len() <= NAMED || values.values().any(|count| *count > 1) {
                true => listed(values, Clone::clone),
                false => format!("{} different values", values.len()),
            };
            lines.push(format!("  label       {name}: {shown}"));
        }
    }
}

/// Seconds of a recording that was read.
fn seconds(outcome: &Outcome) -> Option<f64> {
    outcome.sample_rate.map(|rate| outcome.decoded_frames as f64 / f64::from(rate))
}

fn counted<T: Ord>(values: impl Iterator<Item = T>) -> BTreeMap<T, usize> {
    let mut counts = BTreeMap::new();
    values.for_each(|value| *counts.entry(value).or_default() += 1);
    counts
}

/// `dog 40, rain 38 and 8 more`, the most frequent first.
fn listed<T>(counts: &BTreeMap<T, usize>, name: impl Fn(&T) -> String) -> String {
    let mut all: Vec<(&T, usize)> = counts.iter().map(|(value, count)| (value, *count)).collect();
    all.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let shown: Vec<String> =
        all.iter().take(NAMED).map(|(value, count)| format!("{} × {count}", name(value))).collect();
    match all.len().saturating_sub(NAMED) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// The preset with the fewest other values among those of the same features, or a configuration of
/// these features with every default; then every key that differs from it, `key = value (there)`.
pub fn differences(config: &Value) -> (String, Vec<String>) {
    let mut bases: Vec<(String, Value)> = Vec::new();
    for preset in PRESETS {
        if let Ok(preset_config) = Config::preset(preset.name) {
            bases.push((format!("preset {}", preset.name), preset_config.to_value()));
        }
    }
    let kinds = config["features"].as_object().into_iter().flatten();
    let defaults = kinds.map(|(name, feature)| {
        let kind = feature.get("kind").and_then(Value::as_str).unwrap_or(name);
        (name.clone(), serde_json::json!({"kind": kind}))
    });
    let defaults = serde_json::json!({"features": defaults.collect::<serde_json::Map<_, _>>()});
    if let Ok(defaults) = Config::from_value(defaults) {
        bases.push(("every key at its default".into(), defaults.to_value()));
    }
    let found = bases.into_iter().filter(|(_, base)| names(base) == names(config));
    let compared = found.map(|(name, base)| {
        let mut lines = Vec::new();
        compare("", config, &base, &mut lines);
        (name, lines)
    });
    compared.min_by_key(|(_, lines)| lines.len()).unwrap_or_else(|| {
        let mut lines = Vec::new();
        compare("", config, &Value::Null, &mut lines);
        ("nothing that this version knows".into(), lines)
    })
}

/// Names of the features.
fn names(config: &Value) -> Vec<&String> {
    config["features"].as_object().into_iter().flatten().map(|(name, _)| name).collect()
}

/// Adds a line for every key whose value is another one than in `base`.
fn compare(key: &str, value: &Value, base: &Value, lines: &mut Vec<String>) {
    let Value::Object(table) = value else {
        if value != base {
            let there = match base {
                Value::Null => String::new(),
                there => format!("  ({there})"),
            };
            lines.push(format!("{key} = {value}{there}"));
        }
        return;
    };
    for (name, value) in table {
        let key = match key {
            "" | "features" => name.clone(),
            key => format!("{key}.{name}"),
        };
        compare(&key, value, base.get(name).unwrap_or(&Value::Null), lines);
    }
    for (name, there) in base.as_object().into_iter().flatten() {
        if !table.contains_key(name) {
            lines.push(format!("{key}.{name} is not there  ({there})"));
        }
    }
}

/// What the arrays of an output are, in a line: `3 recordings: mfcc 2 × 20 × 16–44 frames`, or the
/// size of its table. `members` are all of its arrays with their shapes.
pub fn shapes<'m>(
    features: &[&str],
    members: impl Iterator<Item = (&'m str, &'m [u64])>,
    npz: bool,
) -> Vec<String> {
    const SUMMARY: &str = "__summary__";
    let members: Vec<(&str, &[u64])> = members.collect();
    if !npz {
        let rows = members.first().map_or(0, |(_, shape)| shape.iter().product());
        return vec![format!("  {} × {} columns", plural(rows, "row"), members.len())];
    }
    if let Some((_, [rows, columns])) = members.iter().find(|(name, _)| *name == SUMMARY) {
        return vec![format!("  {} × {columns} columns", plural(*rows, "row"))];
    }
    let mut ranges: BTreeMap<&str, Vec<[u64; 2]>> = BTreeMap::new();
    let mut recordings = 0;
    for (name, shape) in members.iter().filter(|(name, _)| layout::is_frame_level(name)) {
        let feature = match features {
            [only] => *only,
            _ => name.rsplit('/').next().unwrap_or(name),
        };
        if !features.contains(&feature) || shape.len() != 3 || name.starts_with(layout::TIMES) {
            continue;
        }
        recordings += u64::from(feature == features[0]);
        let range =
            ranges.entry(feature).or_insert_with(|| shape.iter().map(|n| [*n; 2]).collect());
        for (range, n) in range.iter_mut().zip(*shape) {
            *range = [range[0].min(*n), range[1].max(*n)];
        }
    }
    let span = |[low, high]: [u64; 2]| match low == high {
        true => low.to_string(),
        false => format!("{low}–{high}"),
    };
    let array = |feature: &&str| {
        let sizes: Vec<String> = ranges.get(feature)?.iter().map(|range| span(*range)).collect();
        Some(format!("{feature} {} frames", sizes.join(" × ")))
    };
    let arrays: Vec<String> = features.iter().filter_map(array).collect();
    vec![format!("  {}: {}", plural(recordings, "recording"), arrays.join(", "))]
}

fn plural(n: u64, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}
