//! Axes around a plot.

use crate::color::{Paint, sequential};
use crate::drawing::{Anchor, Drawing, Pixels, Rect, TextStyle};
use crate::error::PlotError;
use crate::ticks::{labels, ticks};

/// Where a value lies between the ends of an axis, 0 to 1; the middle of an empty axis.
pub(crate) fn share(value: f64, (low, high): (f64, f64)) -> f64 {
    if high > low { (value - low) / (high - low) } else { 0.5 }
}

/// Lowest and highest finite value, widened a little; 0 to 1 without any.
pub(crate) fn range_of(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let ends = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    match ends {
        (low, high) if low > high => (0.0, 1.0),
        (low, high) if low == high => (low - 0.5, high + 0.5),
        (low, high) => (low - 0.04 * (high - low), high + 0.04 * (high - low)),
    }
}

/// Grid lines and numbers from left to right, with the name of the values below.
pub(crate) fn below(on: &mut Drawing, plot: Rect, range: (f64, f64), grid: bool, label: &str) {
    let values = ticks(range.0, range.1, (plot.w / 70.0).clamp(3.0, 10.0) as usize);
    for (value, text) in values.iter().zip(labels(&values)) {
        let x = plot.x + share(*value, range) * plot.w;
        if grid {
            on.rect(Rect::new(x - 0.5, plot.y, 1.0, plot.h), Paint::Grid);
        } else {
            on.rect(Rect::new(x - 0.5, plot.bottom(), 1.0, 5.0), Paint::Muted);
        }
        on.text(x, plot.bottom() + 17.0, &text, TextStyle::tick(Anchor::Middle));
    }
    let middle = plot.x + plot.w / 2.0;
    on.text(middle, plot.bottom() + 35.0, label, TextStyle::tick(Anchor::Middle));
}

/// Grid lines and numbers from bottom to top, with the name of the values at the left edge.
pub(crate) fn left(on: &mut Drawing, plot: Rect, range: (f64, f64), label: &str) {
    let values = ticks(range.0, range.1, (plot.h / 45.0).clamp(2.0, 8.0) as usize);
    for (value, text) in values.iter().zip(labels(&values)) {
        let y = plot.bottom() - share(*value, range) * plot.h;
        on.rect(Rect::new(plot.x, y - 0.5, plot.w, 1.0), Paint::Grid);
        on.text(plot.x - 8.0, y + 4.0, &text, TextStyle::tick(Anchor::End));
    }
    let middle = plot.y + plot.h / 2.0;
    on.text(18.0, middle, label, TextStyle::tick(Anchor::Middle).upwards());
}

/// The colours of the ramp with their values, at the right of a plot.
pub(crate) fn color_bar(
    on: &mut Drawing,
    bar: Rect,
    range: (f64, f64),
    label: &str,
) -> Result<(), PlotError> {
    let colors = (0..128).rev().map(|i| sequential(i as f32 / 127.0)).collect();
    on.image(bar, &Pixels { width: 1, height: 128, colors })?;
    let values = ticks(range.0, range.1, (bar.h / 40.0).clamp(1.0, 6.0) as usize);
    for (value, text) in values.iter().zip(labels(&values)) {
        let y = bar.bottom() - share(*value, range) * bar.h;
        on.rect(Rect::new(bar.right(), y - 0.5, 4.0, 1.0), Paint::Muted);
        on.text(bar.right() + 7.0, y + 3.5, &text, TextStyle::tick(Anchor::Start));
    }
    let middle = bar.y + bar.h / 2.0;
    on.text(bar.right() + 52.0, middle, label, TextStyle::tick(Anchor::Middle).upwards());
    Ok(())
}
