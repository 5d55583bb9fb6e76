//! Which columns of a table name its rows.

use std::collections::HashSet;

/// Why values do not name rows: one is empty, or there twice.
pub(super) fn not_an_id(ids: &[String]) -> Option<String> {
    if let Some(row) = ids.iter().position(String::is_empty) {
        return Some(format!("row {row} has no id"));
    }
    let mut seen = HashSet::new();
    let twice = ids.iter().find(|id| !seen.insert(id.as_str()))?;
    Some(format!("id {twice:?} occurs twice"))
}
