//! Distributions side by side: a box for each group, on one scale.

use crate::axis::{below, range_of, share};
use crate::color::Paint;
use crate::drawing::{Anchor, Drawing, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::font;

/// A group of values.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxRow {
    /// Name at the left.
    pub name: String,
    /// Its values; those that are not finite are left out.
    pub values: Vec<f64>,
}

/// Boxes from the first to the third quartile with the median, whiskers to the farthest values within 1.5 times
/// the box's length, and dots for the values beyond. The scale ends at the whiskers: a number says how many dots lie
/// outside.
#[derive(Debug, Clone)]
pub struct BoxPlot {
    /// Heading.
    pub title: String,
    /// Name of the values with their unit.
    pub value_label: String,
    /// The groups, from top to bottom.
    pub rows: Vec<BoxRow>,
}

const WIDTH: f64 = 420.0;
const NAME: f64 = 200.0;
const SIZE: f64 = 12.0;
const RIGHT: f64 = 108.0;
const TOP: f64 = 46.0;
const LINE: f64 = 26.0;

/// What is drawn of a group.
#[derive(Debug, Clone, PartialEq)]
struct Summary {
    whiskers: (f64, f64),
    quartiles: [f64; 3],
    beyond: Vec<f64>,
    count: usize,
}

/// The quantile of sorted values, linear between neighbours.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    low + (high - low) * place.fract()
}

impl BoxRow {
    fn summary(&self) -> Option<Summary> {
        let mut values: Vec<f64> = self.values.iter().copied().filter(|v| v.is_finite()).collect();
        if values.is_empty() {
            return None;
        }
        values.sort_unstable_by(f64::total_cmp);
        let quartiles = [0.25, 0.5, 0.75].map(|q| quantile(&values, q));
        let reach = 1.5 * (quartiles[2] - quartiles[0]);
        let near = |v: &f64| (quartiles[0] - reach..=quartiles[2] + reach).contains(v);
        // A quartile may lie between values of which the inner one is beyond the whisker.
        let low = values.iter().copied().find(near).unwrap_or(quartiles[0]).min(quartiles[0]);
        let high =
            values.iter().rev().copied().find(near).unwrap_or(quartiles[2]).max(quartiles[2]);
        let beyond = values.iter().copied().filter(|v| !near(v)).collect();
        Some(Summary { whiskers: (low, high), quartiles, beyond, count: values.len() })
    }
}

impl BoxPlot {
    fn left(&self) -> f64 {
        let longest = self.rows.iter().map(|r| font::width(&r.name, SIZE, false));
        28.0 + longest.fold(40.0, f64::max).min(NAME)
    }
}

impl Figure for BoxPlot {
    fn size(&self) -> (f64, f64) {
        let title = 32.0 + font::width(&self.title, 15.0, true);
        let height = LINE * self.rows.len() as f64;
        ((self.left() + WIDTH + RIGHT).max(title), TOP + height + 50.0)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        on.text(16.0, 28.0, &self.title, TextStyle::title());
        let plot = Rect::new(self.left(), TOP, WIDTH, LINE * self.rows.len() as f64);
        let rows: Vec<Option<Summary>> = self.rows.iter().map(BoxRow::summary).collect();
        let ends = rows.iter().flatten().flat_map(|s| [s.whiskers.0, s.whiskers.1]);
        // Zero belongs to the scale of what may be too large or too small.
        let range = range_of(ends.chain([0.0]));
        below(on, plot, range, true, &self.value_label);
        let place = |v: f64| plot.x + share(v, range) * plot.w;
        on.rect(Rect::new(place(0.0) - 0.5, plot.y, 1.0, plot.h), Paint::Muted);
        for (i, (row, summary)) in self.rows.iter().zip(&rows).enumerate() {
            let y = plot.y + LINE * (i as f64 + 0.5);
            let name = font::fitted(&row.name, SIZE, false, NAME);
            let style = TextStyle::new(SIZE, Paint::Ink, Anchor::End);
            on.text(plot.x - 10.0, y + 4.0, &name, style);
            let Some(Summary { whiskers, quartiles, beyond, count }) = summary else { continue };
            let [first, median, third] = quartiles;
            let hint = format!(
                "{}: median {median:.1}, quartiles {first:.1} to {third:.1}, whiskers {:.1} to {:.1}, {count} values, {} beyond",
                row.name,
                whiskers.0,
                whiskers.1,
                beyond.len()
            );
            on.hinted(&hint, |on| {
                let span = |on: &mut Drawing, from: f64, to: f64, half: f64, paint: Paint| {
                    let width = (place(to) - place(from)).max(1.0);
                    on.rect(Rect::new(place(from), y - half, width, 2.0 * half), paint);
                };
                span(on, whiskers.0, whiskers.1, 0.75, Paint::Accent);
                for end in [whiskers.0, whiskers.1] {
                    on.rect(Rect::new(place(end) - 0.75, y - 5.0, 1.5, 10.0), Paint::Accent);
                }
                span(on, *first, *third, 8.0, Paint::Paper);
                let width = (place(*third) - place(*first)).max(1.0);
                on.shade(Rect::new(place(*first), y - 8.0, width, 16.0), Paint::Accent, 0.35, 2.0);
                on.rect(Rect::new(place(*median) - 1.0, y - 8.0, 2.0, 16.0), Paint::Ink);
                let shown = beyond.iter().filter(|v| (range.0..=range.1).contains(*v));
                shown.for_each(|v| on.ring(place(*v), y, 2.6, Paint::Accent));
            });
            let outside = beyond.iter().filter(|v| !(range.0..=range.1).contains(*v)).count();
            let text = match outside {
                0 => format!("n {count}"),
                _ => format!("n {count}, {outside} outside"),
            };
            on.text(plot.right() + 8.0, y + 4.0, &text, TextStyle::tick(Anchor::Start));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: &[f64]) -> BoxRow {
        BoxRow { name: "row".into(), values: values.to_vec() }
    }

    #[test]
    fn quartiles_whiskers_and_dots() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 100.0, f64::NAN];
        let summary = row(&values).summary().unwrap();
        assert_eq!(summary.quartiles, [3.0, 5.0, 7.0]);
        assert_eq!((summary.whiskers, summary.count), ((1.0, 8.0), 9));
        assert_eq!(summary.beyond, [100.0]);
        assert_eq!(row(&[f64::NAN]).summary(), None);
        let one = row(&[4.0]).summary().unwrap();
        assert_eq!((one.quartiles, one.whiskers), ([4.0; 3], (4.0, 4.0)));
        // The first quartile of these lies between 0 and 10: the whisker does not end inside the box.
        let skewed = row(&[0.0, 10.0, 10.0, 10.0]).summary().unwrap();
        assert!(skewed.whiskers.0 <= skewed.quartiles[0]);
    }

    #[test]
    fn every_group_is_drawn_and_what_lies_outside_is_told() {
        let mut values = vec![1.0, 2.0, 3.0, 4.0, 5.0];
        values.push(1000.0);
        let plot = BoxPlot {
            title: "Errors".into(),
            value_label: "percent".into(),
            rows: vec![row(&values), row(&[])],
        };
        let svg = crate::to_svg(&plot).unwrap();
        assert!(svg.contains("n 6, 1 outside") && svg.contains("median 3.5"), "{svg}");
    }
}
