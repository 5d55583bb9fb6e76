//! How often values occur.

use crate::axis::{below, left};
use crate::color::Paint;
use crate::drawing::{Drawing, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::font;

/// Counts of values in bins of equal width.
#[derive(Debug, Clone)]
pub struct Histogram {
    /// Heading.
    pub title: String,
    /// Name of the values with their unit.
    pub value_label: String,
    /// What is counted, such as "recordings".
    pub count_label: String,
    /// Ends of the scale.
    pub range: (f64, f64),
    /// Counts of the bins between the ends.
    pub counts: Vec<u64>,
}

const LEFT: f64 = 64.0;
const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 170.0;
const TOP: f64 = 46.0;

impl Histogram {
    /// Counts `values` in `bins` bins from the lowest to the highest; what is not finite is left
    /// out.
    pub fn of(values: &[f64], bins: usize) -> (Vec<u64>, (f64, f64)) {
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let ends = finite
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let (low, high) = match ends {
            (low, high) if low > high => (0.0, 1.0),
            (low, high) if low == high => (low - 0.5, high + 0.5),
            ends => ends,
        };
        let mut counts = vec![0; bins.max(1)];
        for value in finite {
            let bin = ((value - low) / (high - low) * counts.len() as f64) as usize;
            let last = counts.len() - 1;
            counts[bin.min(last)] += 1;
        }
        (counts, (low, high))
    }
}

impl Figure for Histogram {
    fn size(&self) -> (f64, f64) {
        let title = 32.0 + font::width(&self.title, 15.0, true);
        ((LEFT + WIDTH + 24.0).max(title), TOP + HEIGHT + 48.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, TextStyle::title());
        let plot = Rect::new(LEFT, TOP, WIDTH, HEIGHT);
        let most = self.counts.iter().copied().max().unwrap_or(0).max(1) as f64;
        left(on, plot, (0.0, most * 1.05), &self.count_label);
        below(on, plot, self.range, false, &self.value_label);
        let step = plot.w / self.counts.len().max(1) as f64;
        let width = (self.range.1 - self.range.0) / self.counts.len().max(1) as f64;
        for (i, count) in self.counts.iter().enumerate() {
            let height = *count as f64 / (most * 1.05) * plot.h;
            let place = Rect::new(
                plot.x + step * i as f64 + 0.5,
                plot.bottom() - height,
                (step - 1.0).max(0.5),
                height,
            );
            let from = self.range.0 + width * i as f64;
            let hint = format!("{from:.2} to {:.2}: {count}", from + width);
            on.hinted(&hint, |on| on.rect(place, Paint::Accent));
        }
        on.rect(Rect::new(plot.x, plot.bottom() - 0.5, plot.w, 1.0), Paint::Muted);
        Ok(())
    }
}
