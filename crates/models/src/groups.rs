//! Columns whose values name groups of rows that belong together.

use std::collections::HashMap;
use std::hash::Hash;

use crate::dataset::{LabelledTable, Result};
use crate::error::ModelError;
use crate::labels::{Labels, is_missing, missing};
use crate::targets::Classes;
use crate::words::count;

/// Columns that are groups unless the user says otherwise.
pub(crate) const USUAL: [&str; 2] = ["container", "group"];

/// The recordings of windows, which no folds split unless the user names other groups.
pub(crate) const RECORDING: &str = "recording";

/// The first usual column of groups: it has several, and is not the target.
pub fn usual(table: &LabelledTable, target: (&Labels, &Classes)) -> Option<&'static str> {
    let mut columns = USUAL.into_iter();
    columns.find(|column| are_several(table, column) && !is_target(table, column, target))
}

/// The column of recordings that rows are parts of, such as windows: there are several, and it is not the
/// target. In a file of another program, ids that rows share are such a column.
pub(crate) fn recordings<'t>(
    table: &'t LabelledTable,
    target: (&Labels, &Classes),
) -> Option<&'t str> {
    let is_whole = |ids: &&str| table.column(ids).is_ok_and(|ids| missing(&ids) == 0);
    let ids = table.shared_ids().filter(is_whole).filter(|ids| !is_by_class(table, ids, target));
    let mut columns = std::iter::once(RECORDING).chain(ids);
    columns.find(|column| are_several(table, column) && !is_target(table, column, target))
}

/// Whether all rows of a class have one value of a column, so that no folds keep both whole.
pub(crate) fn is_by_class(
    table: &LabelledTable,
    column: &str,
    (_, classes): (&Labels, &Classes),
) -> bool {
    table.column(column).is_ok_and(|values| are_in(&classes.indices().to_vec(), &values))
}

/// Whether all rows of a part have the same whole.
fn are_in<P: Eq + Hash, W: PartialEq>(parts: &[P], wholes: &[W]) -> bool {
    let mut whole_of = HashMap::new();
    let mut rows = parts.iter().zip(wholes);
    rows.all(|(part, whole)| *whole_of.entry(part).or_insert(whole) == whole)
}

/// The first usual column of groups that folds in the column `folds` keep whole: it has several, is not the
/// target, and keeps the `recordings` whole.
pub(crate) fn kept(
    table: &LabelledTable,
    target: (&Labels, &Classes),
    (folds, recordings): (&str, Option<&str>),
) -> Option<&'static str> {
    let folds = table.column(folds).ok()?;
    let recordings = recordings.map(|column| table.column(column)).transpose().ok()?;
    let is_kept = |column: &&str| {
        let Ok(values) = table.column(column) else { return false };
        missing(&values) == 0
            && are_several(table, column)
            && !is_target(table, column, target)
            && are_in(&values, &folds)
            && recordings.as_ref().is_none_or(|recordings| are_in(recordings, &values))
    };
    USUAL.into_iter().find(is_kept)
}

/// Whether a column has several values.
pub(crate) fn are_several(table: &LabelledTable, column: &str) -> bool {
    table.column(column).is_ok_and(|values| Labels::of(&values).0.len() > 1)
}

/// Whether a column is that of the classes.
pub(crate) fn is_target(
    table: &LabelledTable,
    column: &str,
    (labels, classes): (&Labels, &Classes),
) -> bool {
    let mut names = classes.indices().into_iter().map(|&class| &labels.names()[class]);
    table.column(column).is_ok_and(|values| values.iter().all(|value| names.next() == Some(value)))
}

/// The values of a column of groups or folds: every row has one. `otherwise` says what else can be done where not.
///
/// # Errors
/// No such column; rows without a value.
pub fn values(table: &LabelledTable, column: &str, otherwise: &str) -> Result<Vec<String>> {
    let values = table.column(column)?;
    let Some(first) = values.iter().position(|value| is_missing(value)) else {
        return Ok(values);
    };
    let reason = format!(
        "{} without {column} of {}, the first is {}: give every row one, leave these rows out, or use \
         another column{otherwise}",
        count(missing(&values), "row"),
        values.len(),
        table.ids[first]
    );
    Err(ModelError::Groups { reason }.into())
}
