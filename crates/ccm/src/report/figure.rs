//! Pictures as inline SVG; their colours are the page's, so that they follow light and dark.

use std::fmt::Write;

use super::Figure;
use super::html::escape;
use crate::scores::ConfusionMatrix;

/// Side of a cell, and room for the labels, in user units.
const CELL: usize = 54;
const LEFT: usize = 92;
const TOP: usize = 34;
/// The line below a matrix needs so much.
const NARROWEST: usize = 280;

/// How recordings of each class were estimated: the confusion matrix and the F1 of each class.
pub fn classes(caption: &str, names: &[String], matrix: &ConfusionMatrix) -> Figure {
    let svg = confusion(caption, names, matrix) + &class_bars(caption, names, matrix);
    Figure { caption: caption.to_string(), wide: names.len() > 4, svg }
}

/// A confusion matrix: rows are true classes, columns estimated ones, shade is the share of the
/// row. The column "none given" appears only where some recording was not estimated.
fn confusion(caption: &str, names: &[String], matrix: &ConfusionMatrix) -> String {
    let classes = matrix.counts.len();
    let unestimated = matrix.counts.iter().any(|row| row[classes] > 0);
    let columns = classes + usize::from(unestimated);
    let width = (LEFT + columns * CELL + 2).max(NARROWEST);
    let height = TOP + classes * CELL + 26;
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width} {height}\" style=\"max-width:{width}px\" role=\"img\" \
         aria-label=\"{}: confusion matrix\">",
        escape(caption)
    );
    let label = |c: usize| names.get(c).map_or("none given", String::as_str);
    for column in 0..columns {
        let x = LEFT + column * CELL + CELL / 2;
        // Names of two words take two lines.
        let words: Vec<&str> = label(column).splitn(2, ' ').collect();
        for (line, word) in words.iter().rev().enumerate() {
            let y = TOP - 7 - 14 * line;
            let _ = write!(svg, "<text class=\"tick\" x=\"{x}\" y=\"{y}\">{}</text>", escape(word));
        }
    }
    for (row, counts) in matrix.counts.iter().enumerate() {
        let y = TOP + row * CELL;
        let _ = write!(
            svg,
            "<text class=\"tick end\" x=\"{}\" y=\"{}\">{}</text>",
            LEFT - 8,
            y + CELL / 2 + 4,
            escape(label(row))
        );
        let total: u64 = counts.iter().sum();
        for (column, &count) in counts[..columns].iter().enumerate() {
            let share = if total == 0 { 0.0 } else { count as f64 / total as f64 };
            let x = LEFT + column * CELL;
            let kind = if row == column { "hit" } else { "miss" };
            // Text over a dark shade takes the light colour.
            let over = if share > 0.55 { " over" } else { "" };
            let _ = write!(
                svg,
                "<g><title>{} taken for {}: {count} of {total}</title>\
                 <rect class=\"{kind}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"4\" \
                 fill-opacity=\"{:.3}\"/><text class=\"count{over}\" x=\"{}\" y=\"{}\">{}</text></g>",
                escape(label(row)),
                escape(label(column)),
                x + 1,
                y + 1,
                CELL - 2,
                CELL - 2,
                0.05 + 0.95 * share,
                x + CELL / 2,
                y + CELL / 2 + 5,
                if count == 0 { "·".to_string() } else { count.to_string() },
            );
        }
    }
    let _ = write!(
        svg,
        "<text class=\"axis\" x=\"4\" y=\"{}\">rows: true class, columns: estimated class</text></svg>",
        height - 8
    );
    svg
}

/// F1 of each class as horizontal bars, as wide as the matrix above them.
fn class_bars(caption: &str, names: &[String], matrix: &ConfusionMatrix) -> String {
    const BAR: usize = 26;
    let classes = matrix.classes();
    let width = (LEFT + classes.len() * CELL + 2).max(NARROWEST);
    let length = width - LEFT - 50;
    let height = classes.len() * BAR + 30;
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width} {height}\" style=\"max-width:{width}px\" role=\"img\" \
         aria-label=\"{}: F1 of each class\">\
         <text class=\"axis\" x=\"4\" y=\"14\">F1 of each class, percent</text>",
        escape(caption)
    );
    for (i, scores) in classes.iter().enumerate() {
        let y = i * BAR + 26;
        let part = scores.f1 * length as f64;
        let name = names.get(i).map_or("", String::as_str);
        let _ = write!(
            svg,
            "<g><title>{}: precision {:.1} %, recall {:.1} %, {} recordings</title>\
             <text class=\"tick end\" x=\"{}\" y=\"{}\">{}</text>\
             <rect class=\"track\" x=\"{LEFT}\" y=\"{y}\" width=\"{length}\" height=\"18\" rx=\"4\"/>\
             <rect class=\"hit\" x=\"{LEFT}\" y=\"{y}\" width=\"{part:.1}\" height=\"18\" rx=\"4\"/>\
             <text class=\"value\" x=\"{}\" y=\"{}\">{:.1}</text></g>",
            escape(name),
            100.0 * scores.precision,
            100.0 * scores.recall,
            scores.support,
            LEFT - 8,
            y + 13,
            escape(name),
            LEFT + length + 8,
            y + 13,
            100.0 * scores.f1,
        );
    }
    svg.push_str("</svg>");
    svg
}
