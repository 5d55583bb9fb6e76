//! Confusion matrices.

use ndarray::Array2;

use crate::color::{INK, MUTED, PAPER, Rgb, sequential};
use crate::surface::{Anchor, Figure, PlotError, Rect, Surface, TextStyle};

/// Counts of predicted against true classes.
#[derive(Debug, Clone)]
pub struct ConfusionMatrix {
    /// Heading.
    pub title: String,
    /// Names of the classes.
    pub labels: Vec<String>,
    /// `[true class, predicted class]`; rows and columns beyond the labels are not drawn.
    pub counts: Array2<u64>,
}

const LETTER: f64 = 0.6;
const TOP: f64 = 78.0;

impl ConfusionMatrix {
    fn longest(&self) -> f64 {
        self.labels.iter().map(|l| l.chars().count()).max().unwrap_or(0) as f64 * 12.0 * LETTER
    }

    fn cell(&self) -> f64 {
        let wanted: f64 = if self.labels.len() <= 6 { 64.0 } else { 48.0 };
        wanted.max(self.longest() + 10.0).min(110.0)
    }

    fn left(&self) -> f64 {
        46.0 + self.longest()
    }

    fn side(&self) -> f64 {
        self.cell() * self.labels.len() as f64
    }
}

impl Figure for ConfusionMatrix {
    fn size(&self) -> (f64, f64) {
        let title = 32.0 + self.title.chars().count() as f64 * 15.0 * LETTER;
        ((self.left() + self.side() + 24.0).max(title), TOP + self.height() + 22.0)
    }

    fn draw(&self, on: &mut dyn Surface) -> Result<(), PlotError> {
        let text = |size, color, anchor| TextStyle { size, color, anchor, upwards: false };
        on.text(16.0, 28.0, &self.title, text(15.0, INK, Anchor::Start));
        let (left, cell, row_height) = (self.left(), self.cell(), self.row_height());
        let middle = left + self.side() / 2.0;
        on.text(middle, 50.0, "predicted", text(11.0, MUTED, Anchor::Middle));
        let upwards = TextStyle { upwards: true, ..text(11.0, MUTED, Anchor::Middle) };
        on.text(20.0, TOP + self.height() / 2.0, "true", upwards);

        for (i, name) in self.labels.iter().enumerate() {
            let x = left + cell * (i as f64 + 0.5);
            on.text(x, TOP - 8.0, name, text(12.0, INK, Anchor::Middle));
            let y = TOP + row_height * (i as f64 + 0.5) + 4.0;
            on.text(left - 8.0, y, name, text(12.0, INK, Anchor::End));
            let count = |j: usize| self.counts.get((i, j)).copied().unwrap_or(0);
            let total: u64 = (0..self.labels.len()).map(count).fold(0, u64::saturating_add);
            for j in 0..self.labels.len() {
                let share = if total > 0 { count(j) as f32 / total as f32 } else { 0.0 };
                let fill = shade(share);
                let (x, y) = (left + cell * j as f64, TOP + row_height * i as f64);
                on.rect(Rect::new(x + 1.0, y + 1.0, cell - 2.0, row_height - 2.0), fill);
                let ink = if fill.lightness() > 0.6 { INK } else { PAPER };
                let (x, y) = (x + cell / 2.0, y + row_height / 2.0);
                on.text(x, y, &count(j).to_string(), text(13.0, ink, Anchor::Middle));
                let percent = format!("{:.0}%", share * 100.0);
                on.text(x, y + 15.0, &percent, text(10.0, ink, Anchor::Middle));
            }
        }
        Ok(())
    }
}

impl ConfusionMatrix {
    fn row_height(&self) -> f64 {
        self.cell().min(56.0)
    }

    fn height(&self) -> f64 {
        self.row_height() * self.labels.len() as f64
    }
}

/// White for nothing, dark for everything: the ramp downwards, faded in from the paper.
fn shade(share: f32) -> Rgb {
    let Rgb(r, g, b) = sequential(0.62 - 0.5 * share);
    let fade = (share * 4.0).min(1.0);
    let mix = |v: u8| (255.0 - (255.0 - f32::from(v)) * fade).round() as u8;
    Rgb(mix(r), mix(g), mix(b))
}
