//! PNG output: a canvas with two pixels per unit.

use crate::color::{PAPER, Rgb};
use crate::font;
use crate::surface::{Anchor, Pixels, PlotError, Rect, Surface, TextStyle};

/// Pixels per unit of length.
const SCALE: f64 = 2.0;
/// Largest picture, in pixels.
const MAX_PIXELS: usize = 100 << 20;

/// An RGB image to draw on.
pub(crate) struct Canvas {
    width: usize,
    height: usize,
    bytes: Vec<u8>,
}

impl Canvas {
    pub(crate) fn new(width: f64, height: f64) -> Result<Self, PlotError> {
        let [width, height] = [width, height].map(|v| (v * SCALE).ceil().max(1.0) as usize);
        if width.saturating_mul(height) > MAX_PIXELS {
            return Err(PlotError::TooLarge { width, height, limit: MAX_PIXELS });
        }
        let Rgb(r, g, b) = PAPER;
        Ok(Self { width, height, bytes: [r, g, b].repeat(width * height) })
    }

    pub(crate) fn finish(self) -> Result<Vec<u8>, PlotError> {
        encode(self.width, self.height, &self.bytes)
    }

    /// Fills pixels, cut off at the edges; both ranges in pixels.
    fn fill(&mut self, x: (f64, f64), y: (f64, f64), Rgb(r, g, b): Rgb) {
        let clip = |v: f64, max: usize| v.round().clamp(0.0, max as f64) as usize;
        let (left, right) = (clip(x.0, self.width), clip(x.1, self.width));
        for row in clip(y.0, self.height)..clip(y.1, self.height) {
            let start = (row * self.width + left) * 3;
            let end = (row * self.width + right).max(row * self.width + left) * 3;
            for pixel in self.bytes[start..end].chunks_exact_mut(3) {
                pixel.copy_from_slice(&[r, g, b]);
            }
        }
    }
}

/// A range of at least one pixel, so that thin lines and quiet waveforms stay visible.
fn at_least_one(from: f64, to: f64) -> (f64, f64) {
    let (from, to) = (from.min(to).round(), from.max(to).round());
    (from, to.max(from + 1.0))
}

impl Surface for Canvas {
    fn rect(&mut self, r: Rect, fill: Rgb) {
        let x = at_least_one(r.x * SCALE, r.right() * SCALE);
        let y = at_least_one(r.y * SCALE, r.bottom() * SCALE);
        self.fill(x, y, fill);
    }

    fn envelope(&mut self, x: f64, step: f64, spans: &[(f64, f64)], fill: Rgb) {
        for (i, (top, bottom)) in spans.iter().enumerate() {
            let left = (x + step * i as f64) * SCALE;
            let columns = at_least_one(left, left + step * SCALE);
            self.fill(columns, at_least_one(top * SCALE, bottom * SCALE), fill);
        }
    }

    fn text(&mut self, x: f64, y: f64, text: &str, style: TextStyle) {
        // Seven dots make the height of capitals, about 0.7 of the line.
        let dot = (style.size * SCALE / 10.0).round().max(1.0);
        let length = text.chars().count() as f64 * font::ADVANCE as f64 * dot - dot;
        let shift = match style.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => length / 2.0,
            Anchor::End => length,
        };
        let (x, y) = ((x * SCALE).round(), (y * SCALE).round());
        for (i, c) in text.chars().enumerate() {
            let along = (i * font::ADVANCE) as f64 * dot - shift;
            for (row, column) in font::dots(c) {
                let (dx, dy) = (along + column as f64 * dot, (row as f64 - 7.0) * dot);
                if style.upwards {
                    let (left, top) = (x + dy, y - dx - dot);
                    self.fill((left, left + dot), (top, top + dot), style.color);
                } else {
                    let (left, top) = (x + dx, y + dy);
                    self.fill((left, left + dot), (top, top + dot), style.color);
                }
            }
        }
    }

    fn image(&mut self, r: Rect, pixels: &Pixels) -> Result<(), PlotError> {
        let [left, top, right, bottom] = [r.x, r.y, r.right(), r.bottom()].map(|v| v * SCALE);
        let (w, h) = (pixels.width, pixels.height);
        let edge =
            |from: f64, to: f64, i: usize, n: usize| from + (to - from) * i as f64 / n as f64;
        for (k, color) in pixels.colors.iter().take(w * h).enumerate() {
            let (row, column) = (k / w, k % w);
            let x = (edge(left, right, column, w), edge(left, right, column + 1, w));
            let y = (edge(top, bottom, row, h), edge(top, bottom, row + 1, h));
            self.fill(x, y, *color);
        }
        Ok(())
    }
}

/// A PNG of `width * height` RGB pixels.
pub(crate) fn encode(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>, PlotError> {
    let mut file = Vec::new();
    // Sizes are bounded by MAX_PIXELS or by an image in memory; larger ones fail in the encoder.
    let [w, h] = [width, height].map(|v| u32::try_from(v).unwrap_or(u32::MAX));
    let mut encoder = png::Encoder::new(&mut file, w, h);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(file)
}
