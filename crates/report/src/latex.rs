//! Tables for LaTeX, in the style of the package `booktabs`.

use std::fmt::Write;

use crate::table::{Cell, Table};

/// Text for LaTeX.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(c);
            }
            '\\' => out.push_str("\\textbackslash{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '<' => out.push_str("\\textless{}"),
            '>' => out.push_str("\\textgreater{}"),
            '\u{2013}' => out.push_str("--"),
            '\u{2212}' => out.push_str("$-$"),
            '\u{b7}' => out.push_str("$\\cdot$"),
            '\u{b1}' => out.push_str("$\\pm$"),
            '\u{d7}' => out.push_str("$\\times$"),
            c => out.push(c),
        }
    }
    out
}

fn cell(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => escape(text),
        Cell::Score(value, None) => format!("{value:.2}"),
        Cell::Score(value, Some((low, high))) => {
            format!("{value:.2} {{\\scriptsize [{low:.1}, {high:.1}]}}")
        }
        Cell::Difference(value) => format!("${value:+.2}$"),
        Cell::Number(_, text) => escape(text),
        Cell::None => "--".into(),
    }
}

/// A `table` environment with the tabular matter, caption and label; it needs `\usepackage{booktabs}`.
pub(crate) fn table(table: &Table) -> String {
    let kinds: String =
        (0..table.columns.len()).map(|c| if table.is_numeric(c) { 'r' } else { 'l' }).collect();
    let line =
        |cells: &mut dyn Iterator<Item = String>| cells.collect::<Vec<_>>().join(" & ") + " \\\\\n";
    let mut out = format!(
        "% \\usepackage{{booktabs}}\n\\begin{{table}}\n\\centering\n\\caption{{{}}}\n\
         \\label{{tab:{}}}\n\\begin{{tabular}}{{{kinds}}}\n\\toprule\n",
        escape(&table.caption),
        table.name
    );
    out.push_str(&line(&mut table.columns.iter().map(|c| escape(c))));
    out.push_str("\\midrule\n");
    for row in &table.rows {
        out.push_str(&line(&mut row.cells.iter().map(cell)));
    }
    let _ = write!(out, "\\bottomrule\n\\end{{tabular}}\n\\end{{table}}\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{Row, Source};

    #[test]
    fn special_characters_are_escaped_and_columns_aligned() {
        let cells = vec![
            Cell::text("ZCR & MFCC_26 50 %"),
            Cell::Score(61.5, Some((58.0, 64.04))),
            Cell::Difference(-3.25),
            Cell::None,
        ];
        let made = table(&Table {
            name: "level".into(),
            caption: "Weighted F1, 95 % intervals".into(),
            columns: ["Method", "F1", "Difference", "Public"].map(String::from).to_vec(),
            rows: vec![Row { source: Source::Ours, cells }],
        });
        assert!(made.contains("\\begin{tabular}{lrrr}\n\\toprule\nMethod & F1 & Difference"));
        assert!(made.contains(
            "ZCR \\& MFCC\\_26 50 \\% & 61.50 {\\scriptsize [58.0, 64.0]} & $-3.25$ & -- \\\\\n"
        ));
        assert!(made.contains("\\label{tab:level}") && made.ends_with("\\end{table}\n"));
    }
}
