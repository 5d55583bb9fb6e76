//! What is odd about a table that can be learned from.

use std::collections::BTreeMap;

use corsmal_files::outcome::Outcome;

use super::table::LabelledTable;
use crate::words::count;

impl LabelledTable {
    /// What is odd, in words: labels taken for features, recordings left out, several sample rates,
    /// features that say nothing.
    pub fn doubts(&self) -> Vec<String> {
        let found = [strange(self), left_out(&self.outcomes), mixed(self), constant(self)];
        found.into_iter().flatten().collect()
    }
}

/// Columns that another program added to statistics of ours, which are taken for features.
fn strange(table: &LabelledTable) -> Option<String> {
    let (ours, others): (Vec<&str>, Vec<&str>) =
        table.feature_names.iter().map(String::as_str).partition(|name| name.contains(['[', '.']));
    (table.config.is_null() && !ours.is_empty() && !others.is_empty()).then(|| {
        format!("{} of decimal numbers, used as features: write labels as text", others.join(", "))
    })
}

/// How many recordings of a run have no features, and why.
fn left_out(outcomes: &[Outcome]) -> Option<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for outcome in outcomes.iter().filter(|outcome| !outcome.status.has_features()) {
        *counts.entry(outcome.status.name()).or_default() += 1;
    }
    let total = counts.values().sum::<usize>();
    let each: Vec<String> = counts.iter().map(|(status, n)| format!("{n} {status}")).collect();
    let recordings = count(outcomes.len(), "recording");
    let have = if total == 1 { "has no features and is" } else { "have no features and are" };
    (total > 0).then(|| format!("{total} of {recordings} {have} left out ({})", each.join(", ")))
}

/// Several sample rates, which the features keep.
fn mixed(table: &LabelledTable) -> Option<String> {
    let mixed = table.trained_on()?.mixed_rates(&table.config)?;
    let rate = usual_rate(&table.outcomes);
    Some(format!("{mixed}; extract with --set signal.sample_rate={rate} to resample them"))
}

/// The sample rate of most recordings in Hz, 0 where none is known.
fn usual_rate(outcomes: &[Outcome]) -> u32 {
    let mut counts: Vec<(u32, usize)> = Vec::new();
    for rate in outcomes.iter().filter_map(|outcome| outcome.sample_rate) {
        match counts.iter_mut().find(|(known, _)| *known == rate) {
            Some((_, count)) => *count += 1,
            None => counts.push((rate, 1)),
        }
    }
    // The first of those that are equally many, as `extract` has it.
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts.first().map_or(0, |(rate, _)| *rate)
}

/// Features that have one value in all rows.
fn constant(table: &LabelledTable) -> Option<String> {
    let columns = table.x.columns().into_iter().enumerate();
    let mut constant = columns.filter(|(_, c)| c.iter().all(|v| *v == c[0])).map(|(i, _)| i);
    let first = constant.next()?;
    Some(format!(
        "{} of {} features have the same value in all rows, the first is {}",
        1 + constant.count(),
        table.x.ncols(),
        table.feature_name(first)
    ))
}
