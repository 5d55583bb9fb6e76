//! What a change does to each of several values.

use crate::axis::{range_of, share};
use crate::color::Paint;
use crate::drawing::{Anchor, Drawing, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::font;

/// A value before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct Slope {
    /// Name at the right end.
    pub name: String,
    /// Value at the left.
    pub before: f64,
    /// Value at the right.
    pub after: f64,
}

/// Lines from the values before to the values after.
#[derive(Debug, Clone)]
pub struct Slopes {
    /// Heading.
    pub title: String,
    /// Name of the left side.
    pub before: String,
    /// Name of the right side.
    pub after: String,
    /// The lines; those with a NaN are left out.
    pub lines: Vec<Slope>,
}

const LEFT: f64 = 92.0;
const WIDTH: f64 = 240.0;
const TOP: f64 = 74.0;
const GAP: f64 = 15.0;

impl Slopes {
    fn shown(&self) -> Vec<&Slope> {
        self.lines.iter().filter(|l| l.before.is_finite() && l.after.is_finite()).collect()
    }

    fn height(&self) -> f64 {
        (GAP * 1.6 * self.shown().len() as f64).max(180.0)
    }

    fn label(line: &Slope) -> String {
        format!("{:.1}  {}", line.after, line.name)
    }

    fn right(&self) -> f64 {
        let widths = self.shown().into_iter().map(|l| font::width(&Self::label(l), 11.0, false));
        widths.fold(60.0, f64::max) + 34.0
    }
}

/// Moves places apart until neighbours keep `gap`; the order stays.
fn spread(places: &mut [(usize, f64)], gap: f64, bottom: f64) {
    places.sort_by(|a, b| a.1.total_cmp(&b.1));
    for i in 1..places.len() {
        places[i].1 = places[i].1.max(places[i - 1].1 + gap);
    }
    let mut limit = bottom;
    for place in places.iter_mut().rev() {
        place.1 = place.1.min(limit);
        limit = place.1 - gap;
    }
}

impl Figure for Slopes {
    fn size(&self) -> (f64, f64) {
        let title = 32.0 + font::width(&self.title, 15.0, true);
        ((LEFT + WIDTH + self.right()).max(title), TOP + self.height() + 24.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, TextStyle::title());
        let lines = self.shown();
        let range = range_of(lines.iter().flat_map(|l| [l.before, l.after]));
        let plot = Rect::new(LEFT, TOP, WIDTH, self.height());
        let y = |v: f64| plot.bottom() - share(v, range) * plot.h;
        let head = TextStyle { bold: true, ..TextStyle::new(11.5, Paint::Muted, Anchor::Middle) };
        for (x, name) in [(plot.x, &self.before), (plot.right(), &self.after)] {
            on.rect(Rect::new(x - 0.5, plot.y - 8.0, 1.0, plot.h + 16.0), Paint::Grid);
            on.text(x, plot.y - 16.0, name, head);
        }
        let mut before: Vec<_> = lines.iter().map(|l| y(l.before)).enumerate().collect();
        let mut after: Vec<_> = lines.iter().map(|l| y(l.after)).enumerate().collect();
        spread(&mut before, GAP, plot.bottom() + 8.0);
        spread(&mut after, GAP, plot.bottom() + 8.0);
        for line in &lines {
            let paint = if line.after < line.before { Paint::Warm } else { Paint::Accent };
            let ends = [(plot.x, y(line.before)), (plot.right(), y(line.after))];
            let hint = format!("{}: {:.2} to {:.2}", line.name, line.before, line.after);
            on.hinted(&hint, |on| {
                on.line(&ends, paint, 1.8, false);
                ends.iter().for_each(|(x, y)| on.disc(*x, *y, 3.5, paint));
            });
        }
        for (i, place) in before {
            let style = TextStyle::tick(Anchor::End);
            on.text(plot.x - 10.0, place + 4.0, &format!("{:.1}", lines[i].before), style);
        }
        for (i, place) in after {
            let style = TextStyle::new(11.0, Paint::Ink, Anchor::Start);
            on.text(plot.right() + 10.0, place + 4.0, &Self::label(lines[i]), style);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_keep_their_distance_and_their_order() {
        let mut places = vec![(0, 50.0), (1, 52.0), (2, 10.0), (3, 99.0), (4, 98.0)];
        spread(&mut places, 10.0, 100.0);
        assert!(places.windows(2).all(|w| w[1].1 - w[0].1 >= 10.0 - 1e-9), "{places:?}");
        assert_eq!(places.iter().map(|p| p.0).collect::<Vec<_>>(), [2, 0, 1, 4, 3]);
        assert!(places.last().unwrap().1 <= 100.0);
    }
}
