//! Columns whose values name groups of rows that belong together.

use crate::dataset::LabelledTable;
use crate::labels::Labels;
use crate::targets::Classes;

/// Columns that are groups unless the user says otherwise.
pub(crate) const USUAL: [&str; 2] = ["container", "group"];

/// The first usual column of groups: it has several, and is not the target.
pub fn usual(table: &LabelledTable, target: (&Labels, &Classes)) -> Option<&'static str> {
    let mut columns = USUAL.into_iter();
    columns.find(|column| are_several(table, column) && !is_target(table, column, target))
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
