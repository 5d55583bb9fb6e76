//! Tables of numbers as colours.

use ndarray::Array2;

use crate::axis::share;
use crate::color::{Paint, sequential};
use crate::drawing::{Anchor, Drawing, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::font;

/// A value for each row and column.
#[derive(Debug, Clone)]
pub struct HeatMap {
    /// Heading.
    pub title: String,
    /// What the values are, with their unit; below the heading.
    pub value_label: String,
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// `[rows, columns]`; NaN is drawn as unknown.
    pub values: Array2<f64>,
    /// Values of the darkest and of the lightest colour.
    pub range: (f64, f64),
}

const SIZE: f64 = 12.0;
const CELL: f64 = 54.0;
const LINE: f64 = 26.0;
const NAME: f64 = 240.0;

impl HeatMap {
    fn left(&self) -> f64 {
        let longest = self.rows.iter().map(|r| font::width(r, SIZE, false)).fold(40.0, f64::max);
        28.0 + longest.min(NAME)
    }

    fn heads(&self) -> Vec<Vec<String>> {
        self.columns.iter().map(|c| font::wrapped(c, SIZE, false, CELL - 4.0)).collect()
    }

    fn top(&self) -> f64 {
        58.0 + 14.0 * self.heads().iter().map(Vec::len).max().unwrap_or(1) as f64
    }
}

impl Figure for HeatMap {
    fn size(&self) -> (f64, f64) {
        let title = 32.0 + font::width(&self.title, 15.0, true);
        let width = self.left() + CELL * self.columns.len() as f64 + 20.0;
        (width.max(title), self.top() + LINE * self.rows.len() as f64 + 16.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, TextStyle::title());
        on.text(16.0, 46.0, &self.value_label, TextStyle::tick(Anchor::Start));
        let (left, top) = (self.left(), self.top());
        for (c, lines) in self.heads().iter().enumerate() {
            let x = left + CELL * (c as f64 + 0.5);
            for (k, line) in lines.iter().rev().enumerate() {
                let style = TextStyle::new(SIZE, Paint::Ink, Anchor::Middle);
                on.text(x, top - 7.0 - 14.0 * k as f64, line, style);
            }
        }
        for (r, name) in self.rows.iter().enumerate() {
            let y = top + LINE * r as f64;
            let style = TextStyle::new(SIZE, Paint::Ink, Anchor::End);
            on.text(left - 8.0, y + 17.0, &font::fitted(name, SIZE, false, NAME), style);
            for (c, column) in self.columns.iter().enumerate() {
                let value = self.values.get((r, c)).copied().unwrap_or(f64::NAN);
                let place =
                    Rect::new(left + CELL * c as f64 + 1.0, y + 1.0, CELL - 2.0, LINE - 2.0);
                let x = left + CELL * (c as f64 + 0.5);
                if !value.is_finite() {
                    let style = TextStyle::new(SIZE, Paint::Muted, Anchor::Middle);
                    on.text(x, y + 17.0, "–", style);
                    continue;
                }
                on.hinted(&format!("{name}, {column}: {value:.2}"), |on| {
                    let color = sequential(share(value, self.range) as f32);
                    on.shade(place, Paint::Fixed(color), 1.0, 2.0);
                    // The ramp is the same on any paper, and so is the text on it.
                    let ink = if color.lightness() > 0.55 { Paint::Ink } else { Paint::Paper };
                    let style = TextStyle::new(11.5, Paint::Fixed(ink.color()), Anchor::Middle);
                    on.text(x, y + 17.0, &format!("{value:.1}"), style);
                });
            }
        }
        Ok(())
    }
}
