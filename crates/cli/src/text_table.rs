//! Tables on a terminal.

use comfy_table::{CellAlignment, Table, presets};
use corsmal_models::predictions::UNKNOWN;

/// Columns of a plain terminal: wider tables change their form.
pub use crate::paragraphs::WIDTH;

/// A table without lines: first column left, the others right.
pub struct TextTable(Table);

impl TextTable {
    /// An empty table with its heads.
    pub fn new<S: ToString>(heads: impl IntoIterator<Item = S>) -> Self {
        let mut table = Table::new();
        table.load_preset(presets::NOTHING);
        table.set_header(heads.into_iter().map(|head| head.to_string()));
        for (at, column) in table.column_iter_mut().enumerate() {
            let side = if at == 0 { CellAlignment::Left } else { CellAlignment::Right };
            column.set_cell_alignment(side);
            column.set_padding((0, 2));
        }
        Self(table)
    }

    /// Aligns a column of words to the left.
    pub fn left(mut self, columns: &[usize]) -> Self {
        for &at in columns {
            if let Some(column) = self.0.column_mut(at) {
                column.set_cell_alignment(CellAlignment::Left);
            }
        }
        self
    }

    /// Wraps text so that lines have at most [`WIDTH`] columns.
    pub fn wrapped(mut self) -> Self {
        self.0.set_content_arrangement(comfy_table::ContentArrangement::Dynamic);
        self.0.set_width(WIDTH as u16);
        self
    }

    /// Appends a line.
    pub fn row<S: ToString>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.0.add_row(cells.into_iter().map(|cell| cell.to_string()));
    }

    /// Lines without trailing spaces.
    pub fn text(&self) -> String {
        let lines: Vec<String> = self.0.lines().map(|line| line.trim_end().to_string()).collect();
        lines.join("\n")
    }
}

/// A share as percent with two decimals.
pub fn percent(share: f64) -> String {
    format!("{:.2}", 100.0 * share)
}

/// A confusion matrix: class names as heads where they fit, else numbers.
pub fn confusion(names: &[String], rows: &[Vec<u64>], unknown: &[u64]) -> String {
    let width =
        |names: &[String]| names.iter().map(|n| n.chars().count().max(3) + 2).sum::<usize>();
    let longest = names.iter().map(|n| n.chars().count()).max().unwrap_or(0).max(15);
    let fits = longest + 2 + width(names) <= WIDTH;
    let numbered =
        |at: usize| if fits { names[at].clone() } else { format!("{} {}", at + 1, names[at]) };
    let some_unknown = unknown.iter().any(|n| *n > 0);
    let heads =
        (0..names.len()).map(|at| if fits { names[at].clone() } else { (at + 1).to_string() });
    let is_class = names.iter().any(|name| name == UNKNOWN);
    let head = if is_class { "no prediction" } else { UNKNOWN };
    let unknown_head = some_unknown.then(|| head.to_string());
    let mut table = TextTable::new(
        ["true, predicted".to_string()].into_iter().chain(heads).chain(unknown_head),
    );
    for (at, row) in rows.iter().enumerate() {
        let counts =
            row.iter().map(u64::to_string).chain(some_unknown.then(|| unknown[at].to_string()));
        table.row([numbered(at)].into_iter().chain(counts));
    }
    table.text()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_of_many_classes_stays_within_the_terminal() {
        let names: Vec<String> = (0..10).map(|n| format!("a long class name {n}")).collect();
        let rows = vec![vec![12u64; 10]; 10];
        let text = confusion(&names, &rows, &[0; 10]);
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        assert!(text.contains("10 a long class name 9"), "{text}");
        let text = confusion(&["a".into(), "b".into()], &[vec![1, 2], vec![3, 4]], &[0, 5]);
        assert!(text.starts_with("true, predicted  a  b  unknown"), "{text}");
        let text = confusion(&["a".into(), UNKNOWN.into()], &[vec![1, 2], vec![3, 4]], &[0, 5]);
        assert!(text.starts_with("true, predicted  a  unknown  no prediction"), "{text}");
    }
}
