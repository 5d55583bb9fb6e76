//! The groups of recordings by both of two files.

use std::collections::HashMap;

use crate::labels::is_missing;
use crate::predictions::{Id, PredictionError, PredictionTable};

/// The column of groups and the group of each row of the first file, from whichever file has one; the
/// order of the files does not matter. `places` are the rows of the second file.
///
/// # Errors
/// Neither file has the column `wanted`, a recording has no group, or the files group recordings
/// differently; names of the groups may differ.
pub(super) fn of_both<'t>(
    first: &'t PredictionTable,
    second: &'t PredictionTable,
    (target, wanted): (Option<&str>, Option<&'t str>),
    places: &HashMap<&Id, usize>,
) -> Result<Option<(&'t str, Vec<&'t str>)>, PredictionError> {
    let usual = [first, second].into_iter().filter_map(|table| table.usual_groups(target));
    let Some(name) = wanted.or_else(|| usual.min_by_key(|(rank, _)| *rank).map(|(_, name)| name))
    else {
        return Ok(None);
    };
    let (here, there) = (first.column(name), second.column(name));
    if here.is_none() && there.is_none() {
        return first.groups(Some(name), target);
    }
    let cell = |of: Option<&Vec<&'t str>>, row: usize| {
        of.map(|of| of[row]).filter(|group| !is_missing(group))
    };
    let pairs =
        first.rows.iter().enumerate().map(|(row, of)| {
            (row, cell(here.as_ref(), row), cell(there.as_ref(), places[&of.key]))
        });
    let pairs: Vec<(usize, Option<&str>, Option<&str>)> = pairs.collect();
    // One group of the other file for each, and the other way round.
    let (mut others, mut own) = (HashMap::new(), HashMap::new());
    for &(row, group, other) in &pairs {
        let Some((group, other)) = group.zip(other) else { continue };
        let (known, known_own) =
            (*others.entry(group).or_insert(other), *own.entry(other).or_insert(group));
        if (known, known_own) != (other, group) {
            return Err(first.content(format!(
                "{:?} is of {name} {group:?} here and of {other:?} in {}, which groups others differently: \
                 correct one of the files, or name other groups with --groups",
                first.rows[row].key.0,
                second.path.display()
            )));
        }
    }
    // A group that only the second file names must not have the name of another group of the first.
    let taken = |other: &str| {
        !own.contains_key(other) && others.get(other).is_some_and(|theirs| *theirs != other)
    };
    let confused =
        pairs.iter().find(|(_, group, other)| group.is_none() && other.is_some_and(taken));
    if let Some(&(row, _, other)) = confused {
        return Err(first.content(format!(
            "{:?} has no {name} here, and its {:?} in {} is the name of another one here: give every row one, or \
             name other groups with --groups",
            first.rows[row].key.0,
            other.unwrap_or_default(),
            second.path.display()
        )));
    }
    let merged = pairs.iter().map(|(_, group, other)| {
        let of_other = other.map(|other| own.get(other).copied().unwrap_or(other));
        group.or(of_other).unwrap_or_default()
    });
    let merged: Vec<&str> = merged.collect();
    first.require_groups(name, &merged)?;
    Ok(Some((name, merged)))
}
