//! Tables of the page.

use std::fmt::Write;

use super::escape::escape;
use crate::table::{Cell, Row, Source, Table};

/// Columns beyond which a table is set closer, without bars.
const MANY: usize = 8;

/// Columns that a narrow page shows in the first cell instead.
const MINOR: [&str; 3] = ["Inputs", "Protocol", "Best in this run"];

pub(super) fn write(out: &mut String, table: &Table) {
    let dense = if table.columns.len() > MANY { " class=\"dense\"" } else { "" };
    let caption = escape(&table.caption);
    let _ = write!(
        out,
        "<div class=\"card\"><p class=\"caption\">{caption}</p>\n\
         <div class=\"scroll\" tabindex=\"0\"><table{dense} aria-label=\"{caption}\">\n<thead><tr>",
    );
    for (i, column) in table.columns.iter().enumerate() {
        let class = if table.is_numeric(i) { "figure" } else { words(table, i) };
        let _ = write!(
            out,
            "<th scope=\"col\" class=\"{class}\"><button type=\"button\">{}</button></th>",
            escape(column)
        );
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    // Whose figures they are is marked only where that differs.
    let mixed = table.rows.iter().any(|r| r.source != table.rows[0].source);
    for row in &table.rows {
        write_row(out, table, row, mixed);
    }
    out.push_str("</tbody></table></div></div>\n");
}

fn words(table: &Table, column: usize) -> &'static str {
    if MINOR.contains(&table.columns[column].as_str()) { "words minor" } else { "words" }
}

fn write_row(out: &mut String, table: &Table, row: &Row, mixed: bool) {
    let (class, badge) = match row.source {
        _ if !mixed => ("plain", ""),
        Source::Ours => ("ours", "this run"),
        Source::Added => ("added", "added"),
        Source::Paper => ("paper", ""),
    };
    let mut badge = match badge {
        "" => String::new(),
        word => format!("<span class=\"badge\">{word}</span>"),
    };
    let minor = MINOR.iter().filter_map(|name| table.columns.iter().position(|c| c == name));
    let minor: Vec<String> = minor
        .filter_map(|at| match &row.cells[at] {
            Cell::Text(text) if !text.is_empty() => Some(escape(text)),
            _ => None,
        })
        .collect();
    if !minor.is_empty() {
        badge.push_str(&format!("<small>{}</small>", minor.join(" \u{b7} ")));
    }
    let bars = table.columns.len() <= MANY;
    let _ = write!(out, "<tr class=\"{class}\">");
    for (i, cell) in row.cells.iter().enumerate() {
        let _ = match cell {
            Cell::Text(text) if i == 0 => {
                write!(out, "<th scope=\"row\">{}{badge}</th>", escape(text))
            }
            Cell::Text(text) => {
                write!(out, "<td class=\"{}\">{}</td>", words(table, i), escape(text))
            }
            Cell::Score(value, interval) => {
                let range = interval.map_or(String::new(), |(low, high)| {
                    format!("<small class=\"range\">{low:.1}\u{2013}{high:.1}</small>")
                });
                let bar = match bars {
                    true => format!(
                        "<i class=\"bar\" style=\"--share:{:.2}%\"></i>",
                        value.clamp(0.0, 100.0)
                    ),
                    false => String::new(),
                };
                write!(
                    out,
                    "<td data-value=\"{value}\"><span class=\"score\">{value:.2}{range}{bar}\
                     </span></td>"
                )
            }
            Cell::Difference(value) => write!(
                out,
                "<td class=\"{}\" data-value=\"{value}\">{}</td>",
                if *value < 0.0 { "less" } else { "more" },
                format!("{value:+.2}").replace('-', "\u{2212}")
            ),
            Cell::Number(value, text) => {
                write!(out, "<td data-value=\"{value}\">{}</td>", escape(text))
            }
            // Without a value, so that sorting leaves it at the end.
            Cell::None => write!(out, "<td class=\"unknown\">\u{2013}</td>"),
        };
    }
    out.push_str("</tr>\n");
}
