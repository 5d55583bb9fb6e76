//! The page.

use std::fmt::Write;

use super::{Cell, Report, Row, Section, Source, Table};

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
    out.push_str("</nav>\n</header>\n<main>\n<dl class=\"facts\">");
    for (name, value) in &report.facts {
        let _ = write!(out, "<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value));
    }
    out.push_str("</dl>\n");
    for section in &report.sections {
        write_section(&mut out, section);
    }
    let _ = write!(
        out,
        "</main>\n<footer><p>Click a heading to sort. The same tables are in \
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
    if !section.figures.is_empty() {
        out.push_str("<div class=\"figures\">\n");
        for figure in &section.figures {
            let _ = writeln!(
                out,
                "<figure>{}<figcaption>{}</figcaption></figure>",
                figure.svg,
                escape(&figure.caption)
            );
        }
        out.push_str("</div>\n");
    }
    out.push_str("</section>\n");
}

fn write_table(out: &mut String, table: &Table) {
    let _ = write!(
        out,
        "<div class=\"scroll\" tabindex=\"0\"><table>\n<caption>{}</caption>\n<thead><tr>",
        escape(&table.caption)
    );
    for column in &table.columns {
        let _ = write!(
            out,
            "<th scope=\"col\"><button type=\"button\">{}</button></th>",
            escape(column)
        );
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    // Whose figures they are is marked only where that differs.
    let mixed = table.rows.iter().any(|r| r.source != table.rows[0].source);
    for row in &table.rows {
        write_row(out, row, mixed);
    }
    out.push_str("</tbody></table></div>\n");
}

fn write_row(out: &mut String, row: &Row, mixed: bool) {
    let (class, badge) = match row.source {
        _ if !mixed => ("plain", ""),
        Source::Ours => ("ours", "<span class=\"badge\">here</span>"),
        Source::Added => ("added", "<span class=\"badge\">added</span>"),
        Source::Paper => ("paper", ""),
    };
    let _ = write!(out, "<tr class=\"{class}\">");
    for (i, cell) in row.cells.iter().enumerate() {
        let _ = match cell {
            Cell::Text(text) if i == 0 => {
                write!(out, "<th scope=\"row\">{}{badge}</th>", escape(text))
            }
            Cell::Text(text) => write!(out, "<td class=\"words\">{}</td>", escape(text)),
            Cell::Score(value) => write!(
                out,
                "<td data-value=\"{value}\" style=\"--share:{:.2}%\"><span>{value:.2}</span></td>",
                value.clamp(0.0, 100.0)
            ),
            Cell::Difference(value) => write!(
                out,
                "<td class=\"{}\" data-value=\"{value}\">{value:+.2}</td>",
                if *value < 0.0 { "less" } else { "more" }
            ),
            Cell::None => write!(out, "<td class=\"unknown\" data-value=\"-1\">–</td>"),
        };
    }
    out.push_str("</tr>\n");
}
