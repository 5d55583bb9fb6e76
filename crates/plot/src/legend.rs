//! What the colours of series mean: entries in rows above a plot.

use crate::color::Paint;
use crate::drawing::{Anchor, Drawing, Rect, TextStyle};
use crate::font;

const LINE: f64 = 20.0;
const SIZE: f64 = 12.0;

/// Rows of (series, distance from the left) that fit a width. One series needs no legend.
fn rows(names: &[String], width: f64) -> Vec<Vec<(usize, f64)>> {
    let mut rows = vec![Vec::new()];
    if names.len() < 2 {
        return Vec::new();
    }
    let mut x = 0.0;
    for (i, name) in names.iter().enumerate() {
        let needed = font::width(name, SIZE, false) + 36.0;
        if x > 0.0 && x + needed > width {
            rows.push(Vec::new());
            x = 0.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((i, x));
        }
        x += needed;
    }
    rows
}

/// Height of a legend.
pub(crate) fn height(names: &[String], width: f64) -> f64 {
    LINE * rows(names, width).len() as f64
}

/// Draws it with its top left corner at (`x`, `y`).
pub(crate) fn draw(on: &mut Drawing, x: f64, y: f64, names: &[String], width: f64) {
    for (line, row) in rows(names, width).iter().enumerate() {
        let y = y + LINE * line as f64;
        for (i, along) in row {
            on.shade(Rect::new(x + along, y + 2.0, 11.0, 11.0), Paint::Series(*i), 1.0, 3.0);
            let style = TextStyle::new(SIZE, Paint::Ink, Anchor::Start);
            on.text(x + along + 17.0, y + 12.0, &names[*i], style);
        }
    }
}
