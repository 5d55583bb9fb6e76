//! Figures as files: SVG, and from the SVG PNG by resvg and PDF by svg2pdf.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg;

use crate::drawing::Drawing;
use crate::error::PlotError;
use crate::font;
use crate::raster::png_of_rgb;

/// Largest picture, in pixels.
const MAX_PIXELS: usize = 100 << 20;
/// Pixels of a figure in an inch.
const UNITS_PER_INCH: f64 = 96.0;
/// Resolution of a PNG unless another is asked for: two pixels for each of the figure.
pub const DEFAULT_DPI: u16 = 192;

/// A picture of known size.
pub trait Figure {
    /// Width and height in pixels, 96 to an inch.
    fn size(&self) -> (f64, f64);

    /// What it shows, in a few words.
    fn title(&self) -> &str;

    /// Draws all of it.
    ///
    /// # Errors
    /// An embedded image could not be encoded.
    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError>;
}

/// The figure as an SVG document. Its marks have classes (`f-ink`, `s-accent`, …: fill or stroke and
/// a meaning), by which a page that embeds it can give them its own colours.
///
/// # Errors
/// An embedded image could not be encoded.
pub fn to_svg(figure: &dyn Figure) -> Result<String, PlotError> {
    let (width, height) = figure.size();
    let mut drawing = Drawing::new(width, height, figure.title());
    figure.draw(&mut drawing)?;
    Ok(drawing.finish())
}

fn tree(svg: &str) -> Result<usvg::Tree, PlotError> {
    let options = usvg::Options {
        font_family: font::FAMILY.into(),
        fontdb: font::database(svg),
        ..usvg::Options::default()
    };
    usvg::Tree::from_str(svg, &options).map_err(|e| PlotError::Svg(e.to_string()))
}

/// The figure as a PNG of `dpi` pixels per inch ([`DEFAULT_DPI`] gives two for each of its own).
///
/// # Errors
/// The picture is too large, or encoding failed.
pub fn to_png(figure: &dyn Figure, dpi: u16) -> Result<Vec<u8>, PlotError> {
    let (width, height) = figure.size();
    let scale = f64::from(dpi.max(1)) / UNITS_PER_INCH;
    let [across, down] = [width, height].map(|v| (v * scale).ceil().max(1.0) as usize);
    let too_large = PlotError::TooLarge { width: across, height: down, limit: MAX_PIXELS };
    if across.saturating_mul(down) > MAX_PIXELS {
        return Err(too_large);
    }
    let sizes = u32::try_from(across).ok().zip(u32::try_from(down).ok());
    let Some(mut canvas) = sizes.and_then(|(w, h)| Pixmap::new(w, h)) else {
        return Err(too_large);
    };
    canvas.fill(resvg::tiny_skia::Color::WHITE);
    let tree = tree(&to_svg(figure)?)?;
    resvg::render(&tree, Transform::from_scale(scale as f32, scale as f32), &mut canvas.as_mut());
    // The canvas is opaque, so that its colours are not premultiplied.
    let rgb: Vec<u8> = canvas.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    png_of_rgb(across, down, &rgb, Some(dpi))
}

/// The figure as a PDF page of its size, with its text as text.
///
/// # Errors
/// The writer failed.
pub fn to_pdf(figure: &dyn Figure) -> Result<Vec<u8>, PlotError> {
    let tree = tree(&to_svg(figure)?)?;
    let page = svg2pdf::PageOptions { dpi: UNITS_PER_INCH as f32 };
    svg2pdf::to_pdf(&tree, svg2pdf::ConversionOptions::default(), page)
        .map_err(|e| PlotError::Pdf(e.to_string()))
}
