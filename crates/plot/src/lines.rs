//! Curves.

use crate::axis::{below, left, range_of, share};
use crate::color::Paint;
use crate::drawing::{Drawing, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::{font, legend};

/// A curve.
#[derive(Debug, Clone)]
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// Its points, in order; those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
    /// Lower and upper ends of a band around it, one for each point; empty for none.
    pub band: Vec<(f64, f64)>,
}

/// Curves over common axes.
#[derive(Debug, Clone)]
pub struct LinePlot {
    /// Heading.
    pub title: String,
    /// Name of the horizontal values with their unit.
    pub x_label: String,
    /// Name of the vertical values with their unit.
    pub y_label: String,
    /// Ends of the horizontal scale; by default those of the points.
    pub x_range: Option<(f64, f64)>,
    /// Ends of the vertical scale; by default those of the points.
    pub y_range: Option<(f64, f64)>,
    /// The curves.
    pub lines: Vec<Line>,
    /// Draw the diagonal for comparison.
    pub diagonal: bool,
    /// Mark the points.
    pub dots: bool,
    /// Join the points.
    pub joined: bool,
}

const LEFT: f64 = 70.0;
const WIDTH: f64 = 400.0;
const HEIGHT: f64 = 280.0;

impl LinePlot {
    fn names(&self) -> Vec<String> {
        self.lines.iter().map(|l| l.name.clone()).collect()
    }

    fn top(&self) -> f64 {
        44.0 + legend::height(&self.names(), WIDTH) + 8.0
    }
}

impl Figure for LinePlot {
    fn size(&self) -> (f64, f64) {
        let title = 32.0 + font::width(&self.title, 15.0, true);
        ((LEFT + WIDTH + 28.0).max(title), self.top() + HEIGHT + 50.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, TextStyle::title());
        legend::draw(on, LEFT, 42.0, &self.names(), WIDTH);
        let plot = Rect::new(LEFT, self.top(), WIDTH, HEIGHT);
        let points = || self.lines.iter().flat_map(|l| &l.points);
        let bands = self.lines.iter().flat_map(|l| &l.band).flat_map(|(low, high)| [*low, *high]);
        let xs = self.x_range.unwrap_or_else(|| range_of(points().map(|p| p.0)));
        let ys = self.y_range.unwrap_or_else(|| range_of(points().map(|p| p.1).chain(bands)));
        left(on, plot, ys, &self.y_label);
        below(on, plot, xs, true, &self.x_label);
        let place = |(x, y): (f64, f64)| {
            let along = share(x, xs).clamp(0.0, 1.0);
            (plot.x + along * plot.w, plot.bottom() - share(y, ys).clamp(0.0, 1.0) * plot.h)
        };
        if self.diagonal {
            on.line(&[place((xs.0, ys.0)), place((xs.1, ys.1))], Paint::Muted, 1.0, true);
        }
        for (i, line) in self.lines.iter().enumerate() {
            let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
            let paint = Paint::Series(i);
            if line.band.len() == line.points.len() {
                let ends = || line.points.iter().zip(&line.band).filter(|(p, _)| finite(p));
                let upper = ends().map(|(p, b)| place((p.0, b.1)));
                let lower = ends().map(|(p, b)| place((p.0, b.0)));
                let outline: Vec<_> =
                    upper.chain(lower.collect::<Vec<_>>().into_iter().rev()).collect();
                on.area(&outline, paint, 0.15);
            }
            let points: Vec<_> = line.points.iter().copied().filter(|p| finite(p)).collect();
            let placed: Vec<_> = points.iter().copied().map(place).collect();
            if self.joined {
                on.line(&placed, paint, 2.0, false);
            }
            if self.dots {
                for (point, (x, y)) in points.iter().zip(&placed) {
                    let hint = format!("{}: {:.3} at {:.3}", line.name, point.1, point.0);
                    on.hinted(&hint, |on| on.disc(*x, *y, 3.5, paint));
                }
            }
        }
        Ok(())
    }
}
