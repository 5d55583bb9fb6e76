//! Features of a recording over time.

use ndarray::Array2;

use crate::axis::{below, color_bar, range_of, share};
use crate::color::{Paint, sequential};
use crate::drawing::{Anchor, Drawing, Pixels, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::font;
use crate::ticks::{apart, labels, ticks};

/// One feature of one channel.
#[derive(Debug, Clone)]
pub struct FeaturePanel {
    /// Heading, such as "mfcc, channel 0".
    pub label: String,
    /// `[coefficients, frames]`, the lowest coefficient first; what is not finite is drawn as the
    /// lowest value.
    pub values: Array2<f32>,
    /// Where its frames begin and end on the time axis; the whole axis where that is not known.
    pub span: Option<(f64, f64)>,
    /// Labels of rows with their place, 0 at the bottom to 1 at the top, the most wanted first;
    /// empty for the numbers of the rows.
    pub rows: Vec<(f64, f64)>,
    /// Unit of the values.
    pub unit: String,
}

/// Panels below each other over one time axis: one coefficient as a curve, more as colours.
#[derive(Debug, Clone)]
pub struct FeaturePicture {
    /// Heading.
    pub title: String,
    /// A line of facts below it.
    pub subtitle: String,
    /// Start and end of the time axis; frames where no times are known.
    pub time: (f64, f64),
    /// Name of the time axis with its unit.
    pub time_label: String,
    /// The panels, from top to bottom.
    pub panels: Vec<FeaturePanel>,
}

const LEFT: f64 = 76.0;
const WIDTH: f64 = 840.0;
const RIGHT: f64 = 92.0;
const TOP: f64 = 64.0;
const HEAD: f64 = 20.0;
const SPACE: f64 = 14.0;

impl FeaturePicture {
    fn height(&self, panel: &FeaturePanel) -> f64 {
        let many = self.panels.len() > 4;
        match panel.values.nrows() {
            0..=1 => 56.0,
            2..=16 => {
                if many {
                    70.0
                } else {
                    110.0
                }
            }
            _ => {
                if many {
                    90.0
                } else {
                    170.0
                }
            }
        }
    }

    /// The part of a plot that a panel's frames take up.
    fn place(&self, panel: &FeaturePanel, plot: Rect) -> Rect {
        let (from, to) = panel.span.unwrap_or(self.time);
        let [left, right] = [from, to].map(|time| plot.x + share(time, self.time) * plot.w);
        if right > left { Rect::new(left, plot.y, right - left, plot.h) } else { plot }
    }

    fn bottom(&self) -> f64 {
        let heights = self.panels.iter().map(|p| HEAD + self.height(p) + SPACE);
        TOP + heights.sum::<f64>()
    }
}

impl FeaturePanel {
    fn range(&self) -> (f64, f64) {
        let finite = self.values.iter().map(|v| f64::from(*v)).filter(|v| v.is_finite());
        let (low, high) =
            finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        match (low, high) {
            (low, high) if low > high => (0.0, 1.0),
            (low, high) if low == high => (low - 0.5, high + 0.5),
            ends => ends,
        }
    }

    fn draw_curve(&self, on: &mut Drawing, plot: Rect, frames: Rect) {
        let values: Vec<f64> = self.values.iter().map(|v| f64::from(*v)).collect();
        let range = range_of(values.iter().copied());
        let marks = ticks(range.0, range.1, 2);
        for (value, text) in marks.iter().zip(labels(&marks)) {
            let y = plot.bottom() - share(*value, range) * plot.h;
            on.rect(Rect::new(plot.x, y - 0.5, plot.w, 1.0), Paint::Grid);
            on.text(plot.x - 7.0, y + 3.5, &text, TextStyle::tick(Anchor::End));
        }
        let step = frames.w / values.len().max(1) as f64;
        let place = |(i, v): (usize, &f64)| {
            (frames.x + step * (i as f64 + 0.5), plot.bottom() - share(*v, range) * plot.h)
        };
        // A gap where a value is not finite.
        for run in values.iter().enumerate().collect::<Vec<_>>().split(|(_, v)| !v.is_finite()) {
            let mut points: Vec<_> = run.iter().map(|(i, v)| place((*i, v))).collect();
            if let [(x, y)] = points[..] {
                // A single frame is as long as it lasts.
                points = vec![(x - step / 2.0, y), (x + step / 2.0, y)];
            }
            on.line(&points, Paint::Series(2), 1.3, false);
        }
    }

    fn draw_colors(&self, on: &mut Drawing, plot: Rect, frames: Rect) -> Result<(), PlotError> {
        let (rows, columns) = self.values.dim();
        let range = self.range();
        if rows > 0 && columns > 0 {
            let color = |v: f32| sequential(share(f64::from(v), range) as f32);
            let colors = (0..rows).rev().flat_map(|r| self.values.row(r).to_vec());
            let colors = colors.map(color).collect();
            on.image(frames, &Pixels { width: columns, height: rows, colors })?;
        }
        let numbers: Vec<(f64, f64)> = ticks(0.0, rows.saturating_sub(1) as f64, 4)
            .into_iter()
            .filter(|v| v.fract() == 0.0)
            .map(|v| (v, (v + 0.5) / rows.max(1) as f64))
            .collect();
        let wanted = if self.rows.is_empty() { &numbers } else { &self.rows };
        for (value, place) in apart(wanted, plot.h, 13.0) {
            let y = plot.bottom() - place * plot.h;
            on.rect(Rect::new(plot.x - 4.0, y - 0.5, 4.0, 1.0), Paint::Muted);
            on.text(
                plot.x - 7.0,
                y + 3.5,
                &crate::ticks::frequency(value),
                TextStyle::tick(Anchor::End),
            );
        }
        let bar = Rect::new(plot.right() + 18.0, plot.y, 12.0, plot.h);
        color_bar(on, bar, range, &self.unit)
    }
}

impl Figure for FeaturePicture {
    fn size(&self) -> (f64, f64) {
        (LEFT + WIDTH + RIGHT, self.bottom() + 40.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        let room = LEFT + WIDTH + RIGHT - 28.0;
        on.text(14.0, 26.0, &font::fitted(&self.title, 15.0, true, room), TextStyle::title());
        let facts = font::fitted(&self.subtitle, 11.0, false, room);
        on.text(14.0, 45.0, &facts, TextStyle::tick(Anchor::Start));
        let mut y = TOP;
        for panel in &self.panels {
            let name = TextStyle { bold: true, ..TextStyle::new(11.5, Paint::Ink, Anchor::Start) };
            on.text(LEFT, y + 13.0, &font::fitted(&panel.label, 11.5, true, WIDTH), name);
            let plot = Rect::new(LEFT, y + HEAD, WIDTH, self.height(panel));
            let frames = self.place(panel, plot);
            match panel.values.nrows() {
                0..=1 => panel.draw_curve(on, plot, frames),
                _ => panel.draw_colors(on, plot, frames)?,
            }
            y = plot.bottom() + SPACE;
        }
        let plot = Rect::new(LEFT, TOP, WIDTH, self.bottom() - SPACE + 4.0 - TOP);
        on.rect(Rect::new(LEFT, plot.bottom(), WIDTH, 1.0), Paint::Muted);
        if self.time.1 > self.time.0 {
            below(on, plot, self.time, false, &self.time_label);
        }
        Ok(())
    }
}
