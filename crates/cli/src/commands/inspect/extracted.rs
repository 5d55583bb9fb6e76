//! What an output of `extract` says of its recordings, and how its configuration differs from the
//! preset that is nearest.

use std::collections::BTreeMap;

use corsmal_files::layout;
use corsmal_files::outcome::Outcome;
use corsmal_files::table::Table;
use serde::Serialize;

use crate::plural::plural;

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
        let seconds: Vec<f64> = outcomes.clone().filter_map(Outcome::seconds).collect();
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

/// What the arrays of an output are, in a line: `3 recordings: mfcc 2 × 20 × 16–44 frames`, or the
/// size of its table of `n_features`. `members` are all of its arrays with their shapes.
pub fn shapes<'m>(
    features: &[&str],
    members: impl Iterator<Item = (&'m str, &'m [u64])>,
    n_features: usize,
) -> Vec<String> {
    let members: Vec<(&str, &[u64])> = members.collect();
    if n_features > 0 {
        let table = members.iter().find(|(name, _)| *name == layout::SUMMARY);
        // A Parquet table has a column for each feature, and those have as many rows.
        let rows = table.or(members.first()).and_then(|(_, shape)| shape.first()).copied();
        return vec![format!("  {} × {n_features} features", plural(rows.unwrap_or(0), "row"))];
    }
    // Parquet files have a column for each feature, whose lists are not read.
    let columns =
        members.iter().filter(|(name, shape)| features.contains(name) && shape.len() == 1);
    let (names, rows): (Vec<&str>, Vec<u64>) =
        columns.map(|(name, shape)| (*name, shape[0])).unzip();
    if let Some(rows) = rows.first() {
        return vec![format!("  {}: frames of {}", plural(*rows, "recording"), names.join(", "))];
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
