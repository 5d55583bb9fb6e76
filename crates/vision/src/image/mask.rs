//! Masks as PNG.

use std::path::Path;

use super::{MAX_BYTES, decode_png, encode_png};
use crate::error::{Result, VisionError, read};
use crate::mask::Mask;

impl Mask {
    /// Reads a PNG: black outside, one other value inside, whatever the transparency.
    ///
    /// # Errors
    /// [`VisionError`] when the file is damaged, too large, no PNG, has several values beside black (which of them is
    /// the object?), or has the mask in its transparency.
    pub fn read(path: &Path) -> Result<Self> {
        // Cut to 8 bits, a 1 of 16 bits would be 0.
        let (bytes, kept) = (read(path, MAX_BYTES)?, png::Transformations::EXPAND);
        let (mut data, mut seen) = (Vec::new(), Values::default());
        let (width, height) = decode_png(&bytes, path, kept, |row, format| {
            let bytes = format.bits.div_ceil(8);
            // An object in a palette has a colour of any channel.
            let colours = if format.channels > 2 { 3 } else { 1 };
            for pixel in row.chunks_exact(format.channels * bytes) {
                let (colour, opacity) = pixel.split_at(colours * bytes);
                let inside = seen.add(colour, opacity).map_err(|other| {
                    let [one, other] = [other, colour].map(|colour| told(colour, bytes));
                    VisionError::file(
                        path,
                        format!(
                            "a mask with pixels of value {one} and of value {other}; expected black around the \
                             object and one value on it: save the object's pixels alone, as 255 on 0"
                        ),
                    )
                })?;
                data.push(inside);
            }
            Ok(())
        })?;
        if seen.only_opacity() {
            return Err(VisionError::file(
                path,
                "a mask of one colour everywhere, and of different transparency; save the object as white on black, \
                 without transparency",
            ));
        }
        Ok(Self { width, height, data })
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

/// What the pixels of a mask were so far.
#[derive(Default)]
struct Values {
    black: bool,
    /// Colour of those that are not black.
    inside: Option<Vec<u8>>,
    /// Opacity of the first.
    opacity: Option<Vec<u8>>,
    /// Another has another opacity.
    opacities: bool,
}

impl Values {
    /// Whether a pixel is inside.
    ///
    /// # Errors
    /// An earlier pixel had another colour, which is given.
    fn add(&mut self, colour: &[u8], opacity: &[u8]) -> std::result::Result<bool, &[u8]> {
        let first = self.opacity.get_or_insert_with(|| opacity.to_vec());
        self.opacities |= first != opacity;
        if colour.iter().all(|&byte| byte == 0) {
            self.black = true;
            return Ok(false);
        }
        let inside = self.inside.get_or_insert_with(|| colour.to_vec());
        if inside == colour { Ok(true) } else { Err(inside) }
    }

    /// Whether nothing tells pixels apart but their opacity.
    fn only_opacity(&self) -> bool {
        self.opacities && !(self.black && self.inside.is_some())
    }
}

/// The channels of a colour as numbers.
fn told(colour: &[u8], bytes: usize) -> String {
    let number = |channel: &[u8]| channel.iter().fold(0, |n, &byte| n * 256 + u32::from(byte));
    let channels: Vec<String> = colour.chunks(bytes).map(|c| number(c).to_string()).collect();
    channels.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Depth, Rgb};

    /// Which value is the object, nobody can know.
    #[test]
    fn masks_of_several_values_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.png");
        let refused = |color, depth, bytes: &[u8], width: usize| {
            let png = encode_png(width, 1, color, depth, bytes).unwrap();
            std::fs::write(&path, png).unwrap();
            let said = Mask::read(&path).unwrap_err().to_string();
            assert!(said.contains("m.png: a mask "), "{said}");
            said
        };
        use png::{BitDepth, ColorType};
        for (said, values) in [
            // A person and a cup; a background that is not quite black.
            (
                refused(ColorType::Grayscale, BitDepth::Eight, &[0, 1, 2], 3),
                "value 1 and of value 2;",
            ),
            (
                refused(ColorType::Grayscale, BitDepth::Eight, &[10, 255], 2),
                "value 10 and of value 255;",
            ),
            (
                refused(ColorType::Grayscale, BitDepth::Sixteen, &[0, 1, 1, 0], 2),
                "1 and of value 256;",
            ),
            (
                refused(ColorType::Rgb, BitDepth::Eight, &[0, 0, 0, 128, 0, 0, 0, 128, 0], 3),
                "value 128 0 0 and of value 0 128 0;",
            ),
        ] {
            assert!(said.contains(values), "{said}");
        }
        for colour in [0, 255] {
            let pixels = [[colour, 0], [colour, 255]].concat();
            let said = refused(ColorType::GrayscaleAlpha, BitDepth::Eight, &pixels, 2);
            assert!(said.contains("transparency; save the object as white on black"), "{said}");
        }
    }

    /// Cut to 8 bits, a 1 of 16 bits would be outside.
    #[test]
    fn a_mask_of_any_depth_is_what_is_not_black() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.png");
        for value in [1, 255, 256, u16::MAX] {
            let deep = Depth { width: 3, height: 1, data: vec![0, value, 0] };
            std::fs::write(&path, deep.to_png().unwrap()).unwrap();
            assert_eq!(Mask::read(&path).unwrap().data, [false, true, false], "{value}");
        }
        let green = Rgb { width: 2, height: 1, data: vec![0, 0, 0, 0, 128, 0] };
        std::fs::write(&path, green.to_png().unwrap()).unwrap();
        assert_eq!(Mask::read(&path).unwrap().data, [false, true]);
        let clear = encode_png(
            2,
            1,
            png::ColorType::Rgba,
            png::BitDepth::Eight,
            &[0, 0, 0, 255, 1, 0, 0, 0],
        );
        std::fs::write(&path, clear.unwrap()).unwrap();
        assert_eq!(Mask::read(&path).unwrap().data, [false, true]);
        for depth in [png::BitDepth::One, png::BitDepth::Two, png::BitDepth::Four] {
            let bytes = [0b1000_0000];
            let grey = png::ColorType::Grayscale;
            std::fs::write(&path, encode_png(2, 1, grey, depth, &bytes).unwrap()).unwrap();
            assert_eq!(Mask::read(&path).unwrap().data, [true, false], "{depth:?}");
        }
    }
}
