//! Images: depth as 16-bit PNG, colour as PNG or JPEG, masks as PNG.

mod mask;

use std::io::Cursor;
use std::path::Path;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::error::{Result, VisionError, read};

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
        let (bytes, kept) = (read(path, MAX_BYTES)?, png::Transformations::IDENTITY);
        let mut data = Vec::new();
        let (width, height) = decode_png(&bytes, path, kept, |row, format| {
            let Format { channels, bits } = format;
            if (channels, bits) != (1, 16) {
                return Err(VisionError::file(
                    path,
                    format!(
                        "{channels} channels of {bits} bits; a depth image has one of 16 bits, in mm"
                    ),
                ));
            }
            data.extend(row.as_chunks().0.iter().map(|pair| u16::from_be_bytes(*pair)));
            Ok(())
        })?;
        Ok(Self { width, height, data })
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
    /// Largest file that is read, in bytes.
    pub const MAX_BYTES: u64 = MAX_BYTES;

    /// Reads a PNG or JPEG; grey becomes colour, transparency is dropped.
    ///
    /// # Errors
    /// [`VisionError`] when the file is damaged, too large, or no PNG or JPEG.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_bytes(&read(path, MAX_BYTES)?, path)
    }

    /// The same from the bytes of a file; `path` is named in errors.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self> {
        if bytes.len() as u64 > MAX_BYTES {
            let (what, actual) = ("size in bytes", bytes.len() as u64);
            return Err(VisionError::Limit { path: path.into(), what, actual, limit: MAX_BYTES });
        }
        if bytes.starts_with(&[0xff, 0xd8]) {
            return decode_jpeg(bytes, path);
        }
        let to_bytes = png::Transformations::normalize_to_color8();
        let mut data = Vec::new();
        let (width, height) = decode_png(bytes, path, to_bytes, |row, format| {
            match format.channels {
                1 => data.extend(row.iter().flat_map(|&v| [v; 3])),
                2 => data.extend(row.chunks_exact(2).flat_map(|p| [p[0]; 3])),
                3 => data.extend_from_slice(row),
                _ => data.extend(row.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]])),
            }
            Ok(())
        })?;
        Ok(Self { width, height, data })
    }

    /// PNG with three channels of 8 bits.
    ///
    /// # Errors
    /// The size does not fit the values.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        encode_png(self.width, self.height, png::ColorType::Rgb, png::BitDepth::Eight, &self.data)
    }
}

/// What the values of a row are.
#[derive(Clone, Copy)]
struct Format {
    channels: usize,
    bits: usize,
}

/// Width and height of a PNG whose rows `keep` takes: it holds what is needed of them, and no more.
fn decode_png(
    bytes: &[u8],
    path: &Path,
    changes: png::Transformations,
    mut keep: impl FnMut(&[u8], Format) -> Result<()>,
) -> Result<(usize, usize)> {
    let damaged =
        |e: png::DecodingError| VisionError::file(path, format!("not a readable PNG: {e}"));
    let limits = png::Limits { bytes: MAX_PIXELS * 8 };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(changes);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    check_size(width, height, path)?;
    if reader.info().interlaced {
        return Err(VisionError::file(path, "an interlaced PNG; save it without interlacing"));
    }
    let (color, depth) = reader.output_color_type();
    let format = Format { channels: color.samples(), bits: depth as usize };
    // A header may promise what the file does not hold: memory grows with the rows that are there.
    let length = (width * format.channels * format.bits).div_ceil(8);
    let mut rows = 0;
    while let Some(row) = reader.next_row().map_err(damaged)? {
        if rows == height || row.data().len() != length {
            return Err(VisionError::file(path, "it has more pixels than its header says"));
        }
        keep(row.data(), format)?;
        rows += 1;
    }
    if rows != height {
        return Err(VisionError::file(path, "it ends before its last row"));
    }
    Ok((width, height))
}

pub(crate) fn check_size(width: usize, height: usize, path: &Path) -> Result<()> {
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
    // A picture that ends early is no picture, not one with grey below. What of the last row is missing, the
    // decoder does not see.
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xff, marker]);
    if last(0xd9) < last(0xda) {
        return Err(VisionError::file(
            path,
            "not a readable JPEG: it ends before its picture does",
        ));
    }
    let options = DecoderOptions::new_safe()
        .set_strict_mode(true)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::Mask;

    /// 16 x 16 pixels of noise.
    const JPEG: &str = concat!(
        "ffd8ffe000104a46494600010100000100010000ffdb0043001b12141714111b1716171e1c1b2028422b2825",
        "2528513a3d3042605565645f555d5b6a7899816a7190735b5d85b586909ea3abadab6780bcc9baa6c799a8ab",
        "a4ffc0000b080010001001011100ffc400160001010100000000000000000000000000020001ffc4001f1000",
        "0202020105000000000000000000000102112100122231516171e1ffda0008010100003f0068e54927954fbc",
        "008dae366300cc464eaea00d88f24f5fb98cc1ae8f69179fffd9",
    );

    /// What was missing became grey, and the picture was classified.
    #[test]
    fn a_jpeg_that_ends_early_is_refused() {
        let byte = |at: usize| u8::from_str_radix(&JPEG[at..at + 2], 16).unwrap();
        let bytes: Vec<u8> = (0..JPEG.len()).step_by(2).map(byte).collect();
        let path = Path::new("a.jpg");
        let whole = decode_jpeg(&bytes, path).unwrap();
        assert_eq!((whole.width, whole.height), (16, 16));
        for length in 0..bytes.len() {
            let error = decode_jpeg(&bytes[..length], path).unwrap_err().to_string();
            assert!(error.contains("a.jpg: not a readable JPEG"), "{length}: {error}");
        }
    }

    /// A few KB that claim the most pixels, and pixels beyond.
    #[test]
    fn headers_that_promise_too_much_take_no_memory() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.png");
        let small = Depth { width: 2, height: 2, data: vec![1; 4] }.to_png().unwrap();
        let claimed = |width: u32, height: u32| {
            let mut bytes = small.clone();
            bytes[16..20].copy_from_slice(&width.to_be_bytes());
            bytes[20..24].copy_from_slice(&height.to_be_bytes());
            let sum = crc(&bytes[12..29]).to_be_bytes();
            bytes[29..33].copy_from_slice(&sum);
            std::fs::write(&path, bytes).unwrap();
            [
                Depth::read(&path).unwrap_err(),
                Mask::read(&path).unwrap_err(),
                Rgb::read(&path).unwrap_err(),
            ]
            .map(|error| error.to_string())
        };
        for said in claimed(8192, 8192) {
            assert!(said.contains("the number of pixels is 67108864; the limit is"), "{said}");
        }
        for said in claimed(u32::MAX >> 1, 1) {
            assert!(said.contains("m.png"), "{said}");
        }
        for said in claimed(8192, 4096) {
            assert!(said.contains("not a readable PNG") || said.contains("ends before"), "{said}");
        }
        assert!(claimed(0, 2).iter().all(|said| said.contains("m.png")));
    }

    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |sum, &byte| {
            (0..8).fold(sum ^ u32::from(byte), |s, _| (s >> 1) ^ (0xedb8_8320 * (s & 1)))
        })
    }
}
