//! Scores of methods, classes or features: a line each, on one scale, with intervals.

use crate::axis::{below, range_of, share};
use crate::color::Paint;
use crate::drawing::{Anchor, Drawing, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::{font, legend};

/// A value of a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Number of the series that it belongs to.
    pub series: usize,
    /// The value; NaN draws nothing.
    pub value: f64,
    /// Lower and upper end of its interval.
    pub interval: Option<(f64, f64)>,
}

/// A line of the plot.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreRow {
    /// Name at the left.
    pub name: String,
    /// Its values.
    pub marks: Vec<Mark>,
}

/// Values as dots with whiskers, all on one scale.
#[derive(Debug, Clone)]
pub struct ScorePlot {
    /// Heading.
    pub title: String,
    /// Name of the values with their unit.
    pub value_label: String,
    /// Names of the series, for the legend.
    pub series: Vec<String>,
    /// The lines, from top to bottom.
    pub rows: Vec<ScoreRow>,
    /// Ends of the scale; by default those of the values.
    pub range: Option<(f64, f64)>,
}

const WIDTH: f64 = 420.0;
const NAME: f64 = 260.0;
const SIZE: f64 = 12.0;
const RIGHT: f64 = 52.0;

impl ScorePlot {
    fn left(&self) -> f64 {
        let longest = self.rows.iter().map(|r| font::width(&r.name, SIZE, false));
        28.0 + longest.fold(40.0, f64::max).min(NAME)
    }

    fn top(&self) -> f64 {
        44.0 + legend::height(&self.series, WIDTH) + 6.0
    }

    fn line(&self) -> f64 {
        if self.series.len() > 1 { 24.0 } else { 22.0 }
    }

    fn scale(&self) -> (f64, f64) {
        self.range.unwrap_or_else(|| {
            let marks = self.rows.iter().flat_map(|r| &r.marks);
            range_of(marks.flat_map(|m| {
                let (low, high) = m.interval.unwrap_or((m.value, m.value));
                [m.value, low, high]
            }))
        })
    }
}

impl Figure for ScorePlot {
    fn size(&self) -> (f64, f64) {
        let title = 32.0 + font::width(&self.title, 15.0, true);
        let height = self.line() * self.rows.len() as f64;
        ((self.left() + WIDTH + RIGHT).max(title), self.top() + height + 50.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, TextStyle::title());
        legend::draw(on, self.left(), 42.0, &self.series, WIDTH);
        let height = self.line() * self.rows.len() as f64;
        let plot = Rect::new(self.left(), self.top(), WIDTH, height);
        let range = self.scale();
        below(on, plot, range, true, &self.value_label);
        let place = |v: f64| plot.x + share(v, range).clamp(0.0, 1.0) * plot.w;
        for (i, row) in self.rows.iter().enumerate() {
            let y = plot.y + self.line() * (i as f64 + 0.5);
            let name = font::fitted(&row.name, SIZE, false, NAME);
            let style = TextStyle::new(SIZE, Paint::Ink, Anchor::End);
            on.text(plot.x - 10.0, y + 4.0, &name, style);
            on.rect(Rect::new(plot.x, y - 0.5, plot.w, 1.0), Paint::Grid);
            for mark in row.marks.iter().filter(|m| m.value.is_finite()) {
                let paint = Paint::Series(mark.series);
                let interval = mark.interval.filter(|(l, h)| l.is_finite() && h.is_finite());
                let series = self.series.get(mark.series).map_or("", String::as_str);
                let range = interval.map_or(String::new(), |(l, h)| format!(" ({l:.2} to {h:.2})"));
                let hint = format!("{} {series}: {:.2}{range}", row.name, mark.value);
                on.hinted(&hint, |on| {
                    if let Some((low, high)) = interval {
                        let (from, to) = (place(low), place(high));
                        on.rect(Rect::new(from, y - 1.0, (to - from).max(1.0), 2.0), paint);
                        on.rect(Rect::new(from - 0.75, y - 4.0, 1.5, 8.0), paint);
                        on.rect(Rect::new(to - 0.75, y - 4.0, 1.5, 8.0), paint);
                    }
                    match mark.series % 2 {
                        0 => on.disc(place(mark.value), y, 5.0, paint),
                        _ => on.ring(place(mark.value), y, 4.4, paint),
                    }
                });
            }
            // With one series there is room for the number.
            if let ([mark], 0..=1) = (row.marks.as_slice(), self.series.len())
                && mark.value.is_finite()
            {
                let style = TextStyle::tick(Anchor::Start);
                let decimals = if range.1 - range.0 > 20.0 { 1 } else { 3 };
                let text = crate::ticks::signed(&format!("{:.decimals$}", mark.value));
                on.text(plot.right() + 8.0, y + 4.0, &text, style);
            }
        }
        Ok(())
    }
}
