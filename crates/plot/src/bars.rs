//! Grouped bars with error whiskers.

use crate::color::{GRID, INK, MUTED, series};
use crate::surface::{Anchor, Figure, PlotError, Rect, Surface, TextStyle};
use crate::ticks::{labels, ticks};

/// One colour of bars: a value for each group.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// One value per group; NaN draws nothing.
    pub values: Vec<f64>,
    /// Half lengths of the whiskers, one per group; empty for none.
    pub errors: Vec<f64>,
}

/// A chart of values in groups.
#[derive(Debug, Clone)]
pub struct BarChart {
    /// Heading.
    pub title: String,
    /// Name of the values with their unit.
    pub value_label: String,
    /// Names of the groups.
    pub groups: Vec<String>,
    /// The bars within each group.
    pub series: Vec<Series>,
}

const LEFT: f64 = 64.0;
const RIGHT: f64 = 24.0;
const PLOT_HEIGHT: f64 = 260.0;
const LEGEND_LINE: f64 = 20.0;
/// Width of a letter relative to the size of the text.
const LETTER: f64 = 0.6;

fn style(size: f64, anchor: Anchor) -> TextStyle {
    TextStyle { size, color: INK, anchor, upwards: false }
}

impl BarChart {
    fn bar_width(&self) -> f64 {
        match self.groups.len() * self.series.len() {
            0..=8 => 36.0,
            9..=24 => 24.0,
            _ => 16.0,
        }
    }

    fn group_width(&self) -> f64 {
        let bars = self.bar_width() * self.series.len().max(1) as f64;
        let longest = self.groups.iter().map(|g| g.chars().count()).max().unwrap_or(0) as f64;
        // Long names go on several lines, a word on each.
        let word = self.groups.iter().flat_map(|g| g.split(' ')).map(|w| w.chars().count()).max();
        let word = word.unwrap_or(0) as f64;
        (bars + 22.0).max((longest.min(word.max(9.0)) * LETTER * 11.0) + 14.0)
    }

    fn plot_width(&self) -> f64 {
        let titles = [self.title.chars().count() as f64 * 15.0 * LETTER - LEFT, 320.0];
        titles.into_iter().fold(self.group_width() * self.groups.len() as f64, f64::max)
    }

    /// Names of a group, broken into lines that fit under it.
    fn lines(&self, group: &str) -> Vec<String> {
        let fits = (self.group_width() / (11.0 * LETTER)) as usize;
        let mut lines: Vec<String> = Vec::new();
        for word in group.split(' ') {
            match lines.last_mut() {
                Some(line) if line.chars().count() + 1 + word.chars().count() <= fits => {
                    line.push(' ');
                    line.push_str(word);
                }
                _ => lines.push(word.to_owned()),
            }
        }
        lines
    }

    /// Rows of the legend: (series, x) for each entry.
    fn legend(&self) -> Vec<Vec<(usize, f64)>> {
        let mut rows = vec![Vec::new()];
        let mut x = 0.0;
        for (i, s) in self.series.iter().enumerate() {
            let width = s.name.chars().count() as f64 * 12.0 * LETTER + 34.0;
            if x > 0.0 && x + width > self.plot_width() {
                rows.push(Vec::new());
                x = 0.0;
            }
            if let Some(row) = rows.last_mut() {
                row.push((i, x));
            }
            x += width;
        }
        rows
    }

    /// Lowest and highest value of the axis.
    fn range(&self) -> (f64, f64) {
        let ends = self.series.iter().flat_map(|s| {
            s.values.iter().enumerate().flat_map(|(i, v)| {
                let e = s.errors.get(i).copied().unwrap_or(0.0);
                [v - e, v + e]
            })
        });
        let ends = ends.filter(|v| v.is_finite());
        let (low, high) = ends.fold((0.0f64, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        if low == high { (0.0, 1.0) } else { (low * 1.05, high * 1.05) }
    }

    fn top(&self) -> f64 {
        52.0 + LEGEND_LINE * self.legend().len() as f64
    }
}

impl Figure for BarChart {
    fn size(&self) -> (f64, f64) {
        let lines = self.groups.iter().map(|g| self.lines(g).len()).max().unwrap_or(1) as f64;
        (LEFT + self.plot_width() + RIGHT, self.top() + PLOT_HEIGHT + 18.0 + 14.0 * lines)
    }

    fn draw(&self, on: &mut dyn Surface) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, style(15.0, Anchor::Start));
        for (row, entries) in self.legend().iter().enumerate() {
            let y = 52.0 + LEGEND_LINE * row as f64;
            for (i, x) in entries {
                on.rect(Rect::new(LEFT + x, y - 9.0, 11.0, 11.0), series(*i));
                on.text(LEFT + x + 17.0, y, &self.series[*i].name, style(12.0, Anchor::Start));
            }
        }

        let plot = Rect::new(LEFT, self.top(), self.plot_width(), PLOT_HEIGHT);
        let (low, high) = self.range();
        let y = |v: f64| plot.bottom() - (v - low) / (high - low) * plot.h;
        let values = ticks(low, high, 6);
        for (value, label) in values.iter().zip(labels(&values)) {
            on.rect(Rect::new(plot.x, y(*value) - 0.5, plot.w, 1.0), GRID);
            let text = TextStyle { color: MUTED, ..style(11.0, Anchor::End) };
            on.text(plot.x - 8.0, y(*value) + 4.0, &label, text);
        }
        let label = TextStyle { upwards: true, color: MUTED, ..style(12.0, Anchor::Middle) };
        on.text(20.0, plot.y + plot.h / 2.0, &self.value_label, label);

        let group_width = plot.w / self.groups.len().max(1) as f64;
        let bar = self.bar_width();
        let bars = bar * self.series.len() as f64;
        for (g, name) in self.groups.iter().enumerate() {
            let centre = plot.x + group_width * (g as f64 + 0.5);
            for (i, s) in self.series.iter().enumerate() {
                let value = s.values.get(g).copied().unwrap_or(f64::NAN);
                if !value.is_finite() {
                    continue;
                }
                let x = centre - bars / 2.0 + bar * i as f64;
                let (top, bottom) = (y(value.max(0.0)), y(value.min(0.0)));
                on.rect(Rect::new(x + 1.5, top, bar - 3.0, bottom - top), series(i));
                let error = s.errors.get(g).copied().filter(|e| e.is_finite() && *e > 0.0);
                if let Some(e) = error {
                    let (from, to, middle) = (y(value + e), y(value - e), x + bar / 2.0);
                    on.rect(Rect::new(middle - 0.6, from, 1.2, to - from), INK);
                    on.rect(Rect::new(middle - 4.0, from - 0.6, 8.0, 1.2), INK);
                    on.rect(Rect::new(middle - 4.0, to - 0.6, 8.0, 1.2), INK);
                }
                if bar >= 24.0 {
                    let above = y(value.max(0.0) + error.unwrap_or(0.0)) - 4.0;
                    let text = TextStyle { color: MUTED, ..style(10.0, Anchor::Middle) };
                    let shown = if high - low > 20.0 { 1 } else { 3 };
                    let shown = if bar < 36.0 { shown.min(2) } else { shown };
                    on.text(x + bar / 2.0, above, &format!("{value:.shown$}"), text);
                }
            }
            for (k, line) in self.lines(name).iter().enumerate() {
                let below = plot.bottom() + 18.0 + 14.0 * k as f64;
                on.text(centre, below, line, style(11.0, Anchor::Middle));
            }
        }
        on.rect(Rect::new(plot.x, y(0.0) - 0.5, plot.w, 1.0), INK);
        Ok(())
    }
}
