//! Images: depth as 16-bit PNG, colour as PNG or JPEG, masks as PNG.

use std::io::Cursor;
use std::path::Path;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::error::{Result, VisionError, read};
use crate::mask::Mask;

/// Largest file that is read.
const MAX_BYTES: u64 = 64 << 20;
/// Largest width and height in px.
pub(crate) const MAX_SIDE: usize = 8192;
/// Largest number of pixels.
pub(crate) const MAX_PIXELS: usize = 1 << 25;

/// A depth image in mm, row by row; 0 where nothing was measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Depth {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height * width` values.
    pub data: Vec<u16>,
}

/// A colour image, red, green and blue of 8 bits, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height * width * 3` values.
    pub data: Vec<u8>,
}

impl Depth {
    /// Reads a PNG with one channel of 16 bits.
    ///
    /// # Errors
    /// [`VisionError`] when the file is damaged, too large, or another kind of image.
    pub fn read(path: &Path) -> Result<Self> {
        let png = decode_png(&read(path, MAX_BYTES)?, path, false)?;
        if (png.channels, png.bits) != (1, 16) {
            return Err(VisionError::file(
                path,
                format!(
                    "{} channels of {} bits; a depth image has one of 16 bits, in mm",
                    png.channels, png.bits
                ),
            ));
        }
        let pairs = png.data.chunks_exact(2);
        let data = pairs.map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
        Ok(Self { width: png.width, height: png.height, data })
    }

    /// PNG with one channel of 16 bits.
    ///
    /// # Errors
    /// The size does not fit the values.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let bytes: Vec<u8> = self.data.iter().flat_map(|v| v.to_be_bytes()).collect();
        encode_png(
            self.width,
            self.height,
            png::ColorType::Grayscale,
            png::BitDepth::Sixteen,
            &bytes,
        )
    }
}

impl Rgb {
    /// Reads a PNG or JPEG; grey becomes colour, transparency is dropped.
    ///
    /// # Errors
    /// [`VisionError`] when the file is damaged, too large, or no PNG or JPEG.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read(path, MAX_BYTES)?;
        if bytes.starts_with(&[0xff, 0xd8]) {
            return decode_jpeg(&bytes, path);
        }
        let png = decode_png(&bytes, path, true)?;
        let data = match png.channels {
            1 => png.data.iter().flat_map(|&v| [v; 3]).collect(),
            2 => png.data.chunks_exact(2).flat_map(|p| [p[0]; 3]).collect(),
            3 => png.data,
            _ => png.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect(),
        };
        Ok(Self { width: png.width, height: png.height, data })
    }

    /// PNG with three channels of 8 bits.
    ///
    /// # Errors
    /// The size does not fit the values.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        encode_png(self.width, self.height, png::ColorType::Rgb, png::BitDepth::Eight, &self.data)
    }
}

impl Mask {
    /// Reads a PNG; a pixel belongs to the mask where its first channel is not 0.
    ///
    /// # Errors
    /// [`VisionError`] when the file is damaged, too large, or no PNG.
    pub fn read(path: &Path) -> Result<Self> {
        let png = decode_png(&read(path, MAX_BYTES)?, path, true)?;
        let data = png.data.chunks_exact(png.channels).map(|p| p[0] != 0).collect();
        Ok(Self { width: png.width, height: png.height, data })
    }

    /// PNG with one channel of 8 bits, 255 inside.
    ///
    /// # Errors
    /// The size does not fit the values.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let bytes: Vec<u8> = self.data.iter().map(|&inside| 255 * u8::from(inside)).collect();
        encode_png(self.width, self.height, png::ColorType::Grayscale, png::BitDepth::Eight, &bytes)
    }
}

struct Png {
    width: usize,
    height: usize,
    channels: usize,
    bits: usize,
    data: Vec<u8>,
}

fn decode_png(bytes: &[u8], path: &Path, to_bytes: bool) -> Result<Png> {
    let damaged =
        |e: png::DecodingError| VisionError::file(path, format!("not a readable PNG: {e}"));
    let limits = png::Limits { bytes: MAX_PIXELS * 8 };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(if to_bytes {
        png::Transformations::normalize_to_color8()
    } else {
        png::Transformations::IDENTITY
    });
    let mut reader = decoder.read_info().map_err(damaged)?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    check_size(width, height, path)?;
    if reader.info().interlaced {
        return Err(VisionError::file(path, "an interlaced PNG; save it without interlacing"));
    }
    let size =
        reader.output_buffer_size().filter(|&size| size <= MAX_PIXELS * 8).ok_or_else(|| {
            VisionError::file(path, "its pixels need more memory than any image that is read")
        })?;
    // A header may promise what the file does not hold: memory grows with the rows that are there.
    let mut data = Vec::new();
    while let Some(row) = reader.next_row().map_err(damaged)? {
        if data.len() + row.data().len() > size {
            return Err(VisionError::file(path, "it has more rows than its header says"));
        }
        data.extend_from_slice(row.data());
    }
    let (color, depth) = reader.output_color_type();
    let channels = color.samples();
    let bits = depth as usize;
    if data.len() != width * height * channels * bits.div_ceil(8) {
        return Err(VisionError::file(path, "it ends before its last row"));
    }
    Ok(Png { width, height, channels, bits, data })
}

fn check_size(width: usize, height: usize, path: &Path) -> Result<()> {
    let side = width.max(height);
    let (what, actual, limit) = if side > MAX_SIDE {
        ("the longer side in px", side, MAX_SIDE)
    } else {
        ("the number of pixels", width * height, MAX_PIXELS)
    };
    if actual > limit {
        return Err(VisionError::Limit {
            path: path.into(),
            what,
            actual: actual as u64,
            limit: limit as u64,
        });
    }
    if actual == 0 || width == 0 || height == 0 {
        return Err(VisionError::file(path, "an image without pixels"));
    }
    Ok(())
}

fn decode_jpeg(bytes: &[u8], path: &Path) -> Result<Rgb> {
    let options = DecoderOptions::new_safe()
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let damaged = |e| VisionError::file(path, format!("not a readable JPEG: {e}"));
    decoder.decode_headers().map_err(damaged)?;
    let (width, height) =
        decoder.dimensions().ok_or_else(|| VisionError::file(path, "a JPEG without a size"))?;
    check_size(width, height, path)?;
    let data = decoder.decode().map_err(damaged)?;
    if data.len() != width * height * 3 {
        return Err(VisionError::file(path, "its pixels do not fit its size"));
    }
    Ok(Rgb { width, height, data })
}

fn encode_png(
    width: usize,
    height: usize,
    color: png::ColorType,
    depth: png::BitDepth,
    bytes: &[u8],
) -> Result<Vec<u8>> {
    let fault = |e: png::EncodingError| {
        VisionError::Request(format!("cannot write this image as PNG: {e}"))
    };
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(fault)?;
    writer.write_image_data(bytes).map_err(fault)?;
    writer.finish().map_err(fault)?;
    Ok(out)
}
