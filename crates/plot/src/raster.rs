//! Pixels as PNG.

use crate::error::PlotError;

/// A PNG of `width * height` RGB pixels.
pub(crate) fn png_of_rgb(
    width: usize,
    height: usize,
    rgb: &[u8],
    dpi: Option<u16>,
) -> Result<Vec<u8>, PlotError> {
    let mut file = Vec::new();
    // Sizes are bounded by MAX_PIXELS or by an image in memory; larger ones fail in the encoder.
    let [w, h] = [width, height].map(|v| u32::try_from(v).unwrap_or(u32::MAX));
    let mut encoder = png::Encoder::new(&mut file, w, h);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    if let Some(dpi) = dpi {
        let per_metre = (f64::from(dpi) / 0.0254).round() as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: per_metre,
            yppu: per_metre,
            unit: png::Unit::Meter,
        }));
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(file)
}
