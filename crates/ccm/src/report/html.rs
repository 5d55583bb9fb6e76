//! The page.

use std::fmt::Write;

use super::{Cell, Report, Row, Section, Source, Table};

/// Columns beyond which a table is set closer.
const MANY: usize = 8;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Text for HTML, in elements and attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// The whole page.
pub(super) fn page(report: &Report) -> String {
    let title = escape(&report.title);
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n<p>{}</p>\n",
        escape(&report.summary)
    );
    if let Some(warning) = &report.warning {
        let _ = writeln!(out, "<p class=\"warning\" role=\"note\">{}</p>", escape(warning));
    }
    out.push_str("<nav>");
    for section in &report.sections {
        let _ = write!(out, "<a href=\"#{}\">{}</a>", section.id, escape(&section.title));
    }
    out.push_str("</nav>\n<p class=\"hint\">Click a heading of a table to sort by it.</p>\n");
    out.push_str("</header>\n<main>\n<dl class=\"facts\">");
    for (name, value) in &report.facts {
        let _ = write!(out, "<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value));
    }
    out.push_str("</dl>\n");
    for section in &report.sections {
        write_section(&mut out, section);
    }
    let _ = write!(
        out,
        "</main>\n<footer><p>The same tables are in \
         <code>tables/*.csv</code> and <code>report.json</code> beside this page.</p></footer>\n\
         <script>{SCRIPT}</script>\n</body>\n</html>\n"
    );
    out
}

fn write_section(out: &mut String, section: &Section) {
    let _ = writeln!(out, "<section id=\"{}\">\n<h2>{}</h2>", section.id, escape(&section.title));
    for paragraph in &section.text {
        let _ = writeln!(out, "<p>{}</p>", escape(paragraph));
    }
    for table in &section.tables {
        write_table(out, table);
    }
    for (i, group) in section.figures.iter().enumerate() {
        let open = if i == 0 { " open" } else { "" };
        let _ = writeln!(out, "<details{open}><summary>{}</summary>", escape(&group.title));
        out.push_str("<div class=\"figures\">\n");
        for figure in &group.figures {
            let class = if figure.wide { " class=\"wide\"" } else { "" };
            let _ = writeln!(
                out,
                "<figure{class}><figcaption>{}</figcaption>{}</figure>",
                escape(&figure.caption),
                figure.svg
            );
        }
        out.push_str("</div></details>\n");
    }
    out.push_str("</section>\n");
}

fn write_table(out: &mut String, table: &Table) {
    // Many columns stand closer together.
    let dense = if table.columns.len() > MANY { " class=\"dense\"" } else { "" };
    let caption = escape(&table.caption);
    let _ = write!(
        out,
        "<div class=\"card\"><p class=\"caption\">{caption}</p>\n\
         <div class=\"scroll\" tabindex=\"0\"><table{dense} aria-label=\"{caption}\">\n<thead><tr>",
    );
    for (i, column) in table.columns.iter().enumerate() {
        let class = match table.rows.first().map(|row| &row.cells[i]) {
            Some(Cell::Text(_)) if i > 0 => words(table, i),
            _ => "figure",
        };
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

/// Columns that a narrow page shows in the first cell instead.
const MINOR: [&str; 3] = ["Inputs", "Protocol", "Best here"];

fn words(table: &Table, column: usize) -> &'static str {
    if MINOR.contains(&table.columns[column].as_str()) { "words minor" } else { "words" }
}

fn write_row(out: &mut String, table: &Table, row: &Row, mixed: bool) {
    let (class, badge) = match row.source {
        _ if !mixed => ("plain", ""),
        Source::Ours => ("ours", "here"),
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
    let _ = write!(out, "<tr class=\"{class}\">");
    for (i, cell) in row.cells.iter().enumerate() {
        let _ = match cell {
            Cell::Text(text) if i == 0 => {
                write!(out, "<th scope=\"row\">{}{badge}</th>", escape(text))
            }
            Cell::Text(text) => {
                write!(out, "<td class=\"{}\">{}</td>", words(table, i), escape(text))
            }
            Cell::Score(value) => write!(
                out,
                "<td data-value=\"{value}\" style=\"--share:{:.2}%\"><span>{value:.2}</span></td>",
                value.clamp(0.0, 100.0)
            ),
            Cell::Difference(value) => write!(
                out,
                "<td class=\"{}\" data-value=\"{value}\">{}</td>",
                if *value < 0.0 { "less" } else { "more" },
                format!("{value:+.2}").replace('-', "\u{2212}")
            ),
            Cell::None => write!(out, "<td class=\"unknown\" data-value=\"-1\">–</td>"),
        };
    }
    out.push_str("</tr>\n");
}
