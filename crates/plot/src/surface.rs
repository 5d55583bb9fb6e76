//! What figures draw on.

use thiserror::Error;

use crate::color::Rgb;
use crate::raster::Canvas;
use crate::svg::Document;

/// Why a picture could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The picture would have more pixels than is sensible.
    #[error("a picture of {width} x {height} pixels is too large (at most {limit} in all)")]
    TooLarge {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Largest product of both.
        limit: usize,
    },
    /// The PNG encoder failed.
    #[error("cannot encode PNG: {0}")]
    Png(#[from] png::EncodingError),
}

/// Position of a text relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The text starts there.
    Start,
    /// The text is centred there.
    Middle,
    /// The text ends there.
    End,
}

/// Appearance of a text.
#[derive(Debug, Clone, Copy)]
pub struct TextStyle {
    /// Height of the line in pixels.
    pub size: f64,
    /// Colour of the letters.
    pub color: Rgb,
    /// What the position means.
    pub anchor: Anchor,
    /// Reads upwards.
    pub upwards: bool,
}

/// A rectangle: left, top, width, height in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Top edge.
    pub y: f64,
    /// Width.
    pub w: f64,
    /// Height.
    pub h: f64,
}

impl Rect {
    /// A rectangle by its left, top, width and height.
    pub fn new(x: f64, y: f64, w: f64, h: f64) -> Self {
        Self { x, y, w, h }
    }

    /// Right edge.
    pub fn right(&self) -> f64 {
        self.x + self.w
    }

    /// Bottom edge.
    pub fn bottom(&self) -> f64 {
        self.y + self.h
    }
}

/// An image of `width * height` pixels, row by row from the top.
#[derive(Debug, Clone)]
pub struct Pixels {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width * height` colours.
    pub colors: Vec<Rgb>,
}

/// Something to draw on; coordinates in pixels from the top left.
pub trait Surface {
    /// A filled rectangle.
    fn rect(&mut self, rect: Rect, fill: Rgb);

    /// Columns of width `step` side by side from `x` on, each filled from its first to its second
    /// y: the envelope of a waveform.
    fn envelope(&mut self, x: f64, step: f64, spans: &[(f64, f64)], fill: Rgb);

    /// A line of text with its baseline at `y`.
    fn text(&mut self, x: f64, y: f64, text: &str, style: TextStyle);

    /// An image stretched over `rect`, without smoothing.
    fn image(&mut self, rect: Rect, pixels: &Pixels) -> Result<(), PlotError>;
}

/// A picture of known size.
pub trait Figure {
    /// Width and height in pixels.
    fn size(&self) -> (f64, f64);

    /// Draws all of it.
    ///
    /// # Errors
    /// An embedded image could not be encoded.
    fn draw(&self, on: &mut dyn Surface) -> Result<(), PlotError>;
}

/// The figure as an SVG document.
///
/// # Errors
/// An embedded image could not be encoded.
pub fn to_svg(figure: &dyn Figure) -> Result<String, PlotError> {
    let (width, height) = figure.size();
    let mut document = Document::new(width, height);
    figure.draw(&mut document)?;
    Ok(document.finish())
}

/// The figure as a PNG with two pixels per unit.
///
/// # Errors
/// The picture is too large, or encoding failed.
pub fn to_png(figure: &dyn Figure) -> Result<Vec<u8>, PlotError> {
    let (width, height) = figure.size();
    let mut canvas = Canvas::new(width, height)?;
    figure.draw(&mut canvas)?;
    canvas.finish()
}
