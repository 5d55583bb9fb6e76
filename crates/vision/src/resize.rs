//! Parts of colour images, and other sizes.

use crate::image::Rgb;

impl Rgb {
    /// The part with these first columns and rows and those after the last, within the image; `None` where
    /// nothing is left.
    pub fn part(&self, [left, top, right, bottom]: [usize; 4]) -> Option<Self> {
        let (right, bottom) = (right.min(self.width), bottom.min(self.height));
        if left >= right || top >= bottom {
            return None;
        }
        let rows = self.data.chunks_exact(3 * self.width).take(bottom).skip(top);
        let data = rows.flat_map(|row| &row[3 * left..3 * right]).copied().collect();
        Some(Self { width: right - left, height: bottom - top, data })
    }

    /// The whole image in another size: linear between pixels, over as many of them as a new one covers
    /// where the image shrinks, as Pillow and torchvision do it.
    pub fn resized(&self, width: usize, height: usize) -> Self {
        let (columns, rows) = (taps(self.width, width), taps(self.height, height));
        let mut narrow = Vec::with_capacity(self.height * width * 3);
        for row in self.data.chunks_exact(3 * self.width) {
            for (first, weights) in &columns {
                for colour in 0..3 {
                    let pixels = row[3 * first + colour..].iter().step_by(3);
                    narrow.push(sum(weights, pixels.map(|&v| f32::from(v))));
                }
            }
        }
        let mut data = Vec::with_capacity(height * width * 3);
        for (first, weights) in &rows {
            for place in 0..3 * width {
                let pixels = narrow[first * 3 * width + place..].iter().step_by(3 * width);
                data.push(sum(weights, pixels.copied()).round() as u8);
            }
        }
        Self { width, height, data }
    }
}

fn sum(weights: &[f32], values: impl Iterator<Item = f32>) -> f32 {
    weights.iter().zip(values).map(|(weight, value)| weight * value).sum()
}

/// For each new pixel the first old one that it sees, and the weights from there on.
fn taps(from: usize, to: usize) -> Vec<(usize, Vec<f32>)> {
    let scale = from as f64 / to as f64;
    let reach = scale.max(1.0);
    let tap = |i: usize| {
        let centre = (i as f64 + 0.5) * scale;
        let first = (centre - reach + 0.5).max(0.0) as usize;
        let end = ((centre + reach + 0.5) as usize).min(from);
        let weight = |x: usize| 1.0 - ((x as f64 - centre + 0.5) / reach).abs().min(1.0);
        let sum: f64 = (first..end).map(weight).sum();
        (first, (first..end).map(|x| (weight(x) / sum) as f32).collect())
    };
    (0..to).map(tap).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey values row by row.
    fn grey(width: usize, values: &[u8]) -> Rgb {
        let data = values.iter().flat_map(|&v| [v, 255 - v, v / 2]).collect();
        Rgb { width, height: values.len() / width, data }
    }

    #[test]
    fn parts_end_with_the_image() {
        let image = grey(3, &[1, 2, 3, 4, 5, 6]);
        assert_eq!(image.part([1, 0, 9, 9]).unwrap(), grey(2, &[2, 3, 5, 6]));
        assert_eq!(image.part([1, 1, 2, 2]).unwrap(), grey(1, &[5]));
        assert_eq!([image.part([3, 0, 4, 1]), image.part([1, 1, 1, 2])], [None, None]);
    }

    /// Values of Pillow 13.0, `Image.resize(size, Image.Resampling.BILINEAR)`, to one step: it rounds
    /// after each direction.
    #[test]
    fn sizes_change_as_in_pillow() {
        let values: Vec<u8> = (0..7 * 5u32).map(|i| (i * i * 37 % 251) as u8).collect();
        let image = grey(7, &values);
        let red = |image: &Rgb| image.data.iter().step_by(3).map(|&v| i32::from(v)).collect();
        let near = |(width, height): (usize, usize), want: &[i32]| {
            let resized = image.resized(width, height);
            assert_eq!((resized.width, resized.height), (width, height));
            let got: Vec<i32> = red(&resized);
            assert_eq!(got.len(), want.len());
            assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() <= 1), "{got:?}");
        };
        near((3, 2), &PILLOW_SMALL);
        near((9, 6), &PILLOW_LARGE);
        assert_eq!(image.resized(7, 5), image);
    }

    const PILLOW_SMALL: [i32; 6] = [99, 154, 140, 135, 174, 135];
    const PILLOW_LARGE: [i32; 54] = [
        0, 25, 86, 133, 82, 88, 136, 140, 77, //
        42, 75, 145, 202, 160, 176, 128, 121, 191, //
        154, 98, 131, 197, 166, 192, 119, 116, 237, //
        131, 85, 128, 204, 183, 138, 111, 130, 189, //
        37, 97, 171, 224, 213, 113, 124, 141, 113, //
        143, 210, 210, 168, 166, 222, 180, 123, 102, //
    ];
}
