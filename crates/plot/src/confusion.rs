//! Confusion matrices with the score of each class.

use ndarray::Array2;

use crate::color::Paint;
use crate::drawing::{Anchor, Drawing, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::font;

/// Counts of estimated against true classes. Shades are shares of the row: what is right in one
/// colour, what is wrong in another.
#[derive(Debug, Clone)]
pub struct ConfusionMatrix {
    /// Heading.
    pub title: String,
    /// Names of the classes.
    pub labels: Vec<String>,
    /// `[true class, estimated class]`. A column more than there are labels counts what was not
    /// estimated; it is drawn where it has any. Others beyond the labels are not drawn.
    pub counts: Array2<u64>,
    /// F1 of each class in percent, drawn at the right; empty for none.
    pub f1: Vec<f64>,
}

const SIZE: f64 = 12.0;
const BAR: f64 = 96.0;
/// Classes of the largest matrix whose empty cells are drawn.
const LARGE: usize = 24;

impl ConfusionMatrix {
    fn classes(&self) -> usize {
        self.labels.len()
    }

    fn count(&self, row: usize, column: usize) -> u64 {
        self.counts.get((row, column)).copied().unwrap_or(0)
    }

    fn columns(&self) -> usize {
        let n = self.classes();
        n + usize::from((0..n).any(|row| self.count(row, n) > 0))
    }

    fn column_name(&self, column: usize) -> &str {
        self.labels.get(column).map_or("none given", String::as_str)
    }

    fn cell(&self) -> f64 {
        match self.classes() {
            0..=5 => 62.0,
            6..=8 => 54.0,
            9..=12 => 46.0,
            13..=LARGE => 34.0,
            _ => 24.0,
        }
    }

    fn row_height(&self) -> f64 {
        self.cell().min(48.0)
    }

    fn longest(&self) -> f64 {
        let widths = (0..self.columns()).map(|c| font::width(self.column_name(c), SIZE, false));
        widths.fold(0.0, f64::max)
    }

    /// Column heads: lines of each where every word fits its cell, else `None` for upright text.
    fn heads(&self) -> Option<Vec<Vec<String>>> {
        let room = self.cell() - 4.0;
        let heads: Vec<Vec<String>> = (0..self.columns())
            .map(|c| font::wrapped(self.column_name(c), SIZE, false, room))
            .collect();
        let fits = heads.iter().all(|lines| {
            lines.len() <= 3 && lines.iter().all(|line| font::width(line, SIZE, false) <= room)
        });
        fits.then_some(heads)
    }

    fn top(&self) -> f64 {
        68.0 + match self.heads() {
            Some(heads) => 14.0 * heads.iter().map(Vec::len).max().unwrap_or(1) as f64,
            None => self.longest().min(140.0) + 4.0,
        }
    }

    fn left(&self) -> f64 {
        44.0 + self.longest().min(180.0)
    }

    fn width(&self) -> f64 {
        self.cell() * self.columns() as f64
    }

    fn height(&self) -> f64 {
        self.row_height() * self.classes() as f64
    }

    fn draw_heads(&self, on: &mut Drawing) {
        let head = TextStyle::new(SIZE, Paint::Ink, Anchor::Middle);
        let x = |c: usize| self.left() + self.cell() * (c as f64 + 0.5);
        match self.heads() {
            Some(heads) => {
                for (c, lines) in heads.iter().enumerate() {
                    for (k, line) in lines.iter().rev().enumerate() {
                        on.text(x(c), self.top() - 8.0 - 14.0 * k as f64, line, head);
                    }
                }
            }
            None => {
                let style = TextStyle { anchor: Anchor::Start, ..head }.upwards();
                for c in 0..self.columns() {
                    let name = font::fitted(self.column_name(c), SIZE, false, 140.0);
                    on.text(x(c) + 4.0, self.top() - 6.0, &name, style);
                }
            }
        }
    }

    fn draw_row(&self, on: &mut Drawing, row: usize) {
        let (left, cell, height) = (self.left(), self.cell(), self.row_height());
        let y = self.top() + height * row as f64;
        let name = font::fitted(&self.labels[row], SIZE, false, 180.0);
        let style = TextStyle::new(SIZE, Paint::Ink, Anchor::End);
        on.text(left - 8.0, y + height / 2.0 + 4.0, &name, style);
        let total = (0..self.columns()).fold(0u64, |n, c| n.saturating_add(self.count(row, c)));
        // Of many classes most cells are empty: the squares of these say nothing.
        let is_large = self.classes() > LARGE;
        if is_large {
            let place = Rect::new(left + 1.0, y + 1.0, self.width() - 2.0, height - 2.0);
            on.shade(place, Paint::Warm, 0.05, 3.0);
        }
        for column in 0..self.columns() {
            let count = self.count(row, column);
            if is_large && count == 0 {
                continue;
            }
            let share = if total > 0 { count as f64 / total as f64 } else { 0.0 };
            let fill = if row == column { Paint::Accent } else { Paint::Warm };
            let x = left + cell * column as f64;
            let hint = format!(
                "{} estimated as {}: {count} of {total}",
                self.labels[row],
                self.column_name(column)
            );
            on.hinted(&hint, |on| {
                let place = Rect::new(x + 1.0, y + 1.0, cell - 2.0, height - 2.0);
                on.shade(place, fill, 0.05 + 0.95 * share, 3.0);
                let ink = match (count, share > 0.5) {
                    (0, _) => Paint::Muted,
                    (_, true) => Paint::Over,
                    _ => Paint::Ink,
                };
                let text = if count == 0 { "·".to_owned() } else { count.to_string() };
                let x = x + cell / 2.0;
                let middle = y + height / 2.0;
                let small = cell < 40.0 || count == 0;
                let style = TextStyle::new(13.0, ink, Anchor::Middle);
                on.text(x, if small { middle + 4.5 } else { middle + 0.5 }, &text, style);
                if !small {
                    let percent = format!("{:.0} %", share * 100.0);
                    let style = TextStyle::new(10.0, ink, Anchor::Middle);
                    on.text(x, middle + 14.0, &percent, style);
                }
            });
        }
    }

    /// F1 of each class as bars of one scale.
    fn draw_scores(&self, on: &mut Drawing) {
        let x = self.left() + self.width() + 26.0;
        let head = TextStyle::new(SIZE, Paint::Muted, Anchor::Start);
        on.text(x, self.top() - 8.0, "F1, percent", head);
        for (row, f1) in self.f1.iter().enumerate().take(self.classes()) {
            let middle = self.top() + self.row_height() * (row as f64 + 0.5);
            on.shade(Rect::new(x, middle - 6.0, BAR, 12.0), Paint::Grid, 0.7, 3.0);
            if f1.is_finite() {
                let length = f1.clamp(0.0, 100.0) / 100.0 * BAR;
                on.shade(Rect::new(x, middle - 6.0, length, 12.0), Paint::Accent, 1.0, 3.0);
                let style = TextStyle::new(SIZE, Paint::Ink, Anchor::Start);
                on.text(x + BAR + 8.0, middle + 4.0, &format!("{f1:.1}"), style);
            }
        }
    }
}

impl Figure for ConfusionMatrix {
    fn size(&self) -> (f64, f64) {
        let scores = if self.f1.is_empty() { 0.0 } else { 26.0 + BAR + 44.0 };
        let title = 32.0 + font::width(&self.title, 15.0, true);
        ((self.left() + self.width() + scores + 20.0).max(title), self.top() + self.height() + 18.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, TextStyle::title());
        let note = TextStyle::new(11.0, Paint::Muted, Anchor::Middle);
        on.text(self.left() + self.width() / 2.0, 52.0, "estimated class", note);
        on.text(20.0, self.top() + self.height() / 2.0, "true class", note.upwards());
        self.draw_heads(on);
        (0..self.classes()).for_each(|row| self.draw_row(on, row));
        if !self.f1.is_empty() {
            self.draw_scores(on);
        }
        Ok(())
    }
}
