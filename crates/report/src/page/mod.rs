//! The page.

mod escape;
mod tables;

use std::fmt::Write;

use escape::escape;

use crate::{Fact, Figure, Report, Section};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The whole page.
pub(crate) fn page(report: &Report) -> String {
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
    out.push_str("</header>\n<nav aria-label=\"Sections\"><div>");
    for section in &report.sections {
        let _ = write!(out, "<a href=\"#{}\">{}</a>", section.id, escape(&section.title));
    }
    out.push_str("</div></nav>\n<main>\n");
    write_facts(&mut out, &report.facts, "facts");
    for section in &report.sections {
        write_section(&mut out, section);
    }
    let _ = write!(
        out,
        "</main>\n<footer><p>Click a column heading to sort by it. Next to this page, the same \
         tables are in <code>tables</code> as CSV and LaTeX and in <code>report.json</code>, and \
         the same figures in <code>figures</code> as SVG and PDF.</p></footer>\n\
         <script>{SCRIPT}</script>\n</body>\n</html>\n"
    );
    out
}

fn write_facts(out: &mut String, facts: &[Fact], class: &str) {
    if facts.is_empty() {
        return;
    }
    let _ = write!(out, "<dl class=\"{class}\">");
    for Fact { name, value, link } in facts {
        let value = match link {
            Some(link) => format!("<a href=\"{}\">{}</a>", escape(link), escape(value)),
            None => escape(value),
        };
        let _ = write!(out, "<div><dt>{}</dt><dd>{value}</dd></div>", escape(name));
    }
    out.push_str("</dl>\n");
}

fn write_section(out: &mut String, section: &Section) {
    let _ = writeln!(out, "<section id=\"{}\">\n<h2>{}</h2>", section.id, escape(&section.title));
    for paragraph in &section.text {
        let _ = writeln!(out, "<p>{}</p>", escape(paragraph));
    }
    write_facts(out, &section.terms, "terms");
    write_figures(out, &section.figures);
    for table in &section.tables {
        tables::write(out, table);
    }
    for (i, group) in section.groups.iter().enumerate() {
        let open = if i == 0 { " open" } else { "" };
        let _ = writeln!(out, "<details{open}><summary>{}</summary>", escape(&group.title));
        write_figures(out, &group.figures);
        out.push_str("</details>\n");
    }
    for snippet in &section.snippets {
        let _ = writeln!(
            out,
            "<div class=\"card snippet\"><p class=\"caption\">{}</p><pre><code>{}</code></pre></div>",
            escape(&snippet.title),
            escape(&snippet.text)
        );
    }
    out.push_str("</section>\n");
}

fn write_figures(out: &mut String, figures: &[Figure]) {
    if figures.is_empty() {
        return;
    }
    out.push_str("<div class=\"figures\">\n");
    for figure in figures {
        let class = if figure.wide { " class=\"wide\"" } else { "" };
        let _ = write!(
            out,
            "<figure{class}><div class=\"drawing\" tabindex=\"0\">{}</div>",
            figure.svg()
        );
        if !figure.caption.is_empty() {
            let _ = write!(out, "<figcaption>{}</figcaption>", escape(&figure.caption));
        }
        out.push_str("</figure>\n");
    }
    out.push_str("</div>\n");
}
