//! M2's region of interest: where the object stands in a depth image.

use crate::contour::{self, Contour};
use crate::image::Depth;
use crate::mask::Mask;

/// Depths from here on, in mm, are not of the object.
pub const FAR_MM: u16 = 700;
/// Rows from here on show the table.
pub const TABLE_ROW: usize = 600;
/// Side of the network's input in px.
pub const INPUT_SIDE: usize = 112;
/// Frames that are looked at, from the last one backwards.
pub const FRAMES: usize = 30;

/// Borders that enclose less are not of the object, in px².
const SMALLEST_AREA: f64 = 15_000.0;
/// Size of the images that the published program divides by.
const IMAGE: (f64, f64) = (1280.0, 720.0);

/// The region and what M2's network takes from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// First column, first row, column and row after the last, in px.
    pub bounds: [usize; 4],
    /// Depth over 700 mm in the region, resized to 112 by 112, row by row; 0 where there is none or it
    /// is far.
    pub image: Vec<f32>,
    /// Height over 720 and width over 1280.
    pub size: [f32; 2],
}

/// The region of a depth image; `None` where nothing near is large enough.
pub fn region(depth: &Depth) -> Option<Region> {
    let (width, height) = (depth.width, depth.height.min(TABLE_ROW));
    let pixels = &depth.data[..width * height];
    let near = |v: u16| if v < FAR_MM { v } else { 0 };
    let largest = f64::from(pixels.iter().map(|&v| near(v)).max()?);
    // The published program scales to eight bits first: the very nearest pixels become nothing.
    let seen = |v: u16| f64::from(near(v)) / largest * 255.0 >= 1.0;
    let mask = Mask { width, height, data: pixels.iter().map(|&v| seen(v)).collect() };
    let mask = mask.closed(7);
    let candidates: Vec<Contour> =
        contour::contours(&mask).into_iter().filter(|c| c.area() > SMALLEST_AREA).collect();
    let best = match candidates.as_slice() {
        [one] => one,
        many => {
            let means = many.iter().map(|c| mean(pixels, &c.filled(width, height)));
            // The first of equals, as a strict comparison keeps it.
            let best = means.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
            &many[best.0]
        }
    };
    let (left, right, top, bottom) = best.bounds();
    let bounds = expanded([left, top, right + 1, bottom + 1].map(i64::from), width, height);
    let [x0, y0, x1, y1] = bounds;
    let crop: Vec<f64> = (y0..y1)
        .flat_map(|y| (x0..x1).map(move |x| (x, y)))
        .map(|(x, y)| f64::from(near(pixels[y * width + x])) / f64::from(FAR_MM))
        .collect();
    Some(Region {
        bounds,
        image: resize(&crop, x1 - x0, y1 - y0, INPUT_SIDE),
        size: [((y1 - y0) as f64 / IMAGE.1) as f32, ((x1 - x0) as f64 / IMAGE.0) as f32],
    })
}

/// The mean of the unfiltered image, far and unmeasured pixels included.
fn mean(pixels: &[u16], mask: &Mask) -> f64 {
    let of_mask = pixels.iter().zip(&mask.data).filter(|(_, inside)| **inside);
    let (sum, count) =
        of_mask.fold((0.0, 0u32), |(sum, count), (&v, _)| (sum + f64::from(v), count + 1));
    sum / f64::from(count)
}

/// Five per cent larger, half of it on each side, rounded down, within the image.
fn expanded([x0, y0, x1, y1]: [i64; 4], width: usize, height: usize) -> [usize; 4] {
    let more = |size: i64| ((size as f64 * 1.05 - size as f64) / 2.0) as i64;
    let (dx, dy) = (more(x1 - x0), more(y1 - y0));
    let clip = |v: i64, max: usize| v.clamp(0, max as i64) as usize;
    [clip(x0 - dx, width), clip(y0 - dy, height), clip(x1 + dx, width), clip(y1 + dy, height)]
}

/// OpenCV's linear resizing to a square, without smoothing.
fn resize(image: &[f64], width: usize, height: usize, side: usize) -> Vec<f32> {
    // First of two neighbours and the weight of the second.
    let taps = |size: usize| -> Vec<(usize, f64)> {
        let scale = size as f64 / side as f64;
        let tap = |i: usize| {
            let at = ((i as f64 + 0.5) * scale - 0.5) as f32;
            let first = at.floor();
            match first as i64 {
                ..0 => (0, 0.0),
                n if n as usize >= size - 1 => (size - 1, 0.0),
                n => (n as usize, f64::from(at - first)),
            }
        };
        (0..side).map(tap).collect()
    };
    let (columns, rows) = (taps(width), taps(height));
    let mut out = Vec::with_capacity(side * side);
    for &(y, below) in &rows {
        let next = (y + 1).min(height - 1);
        for &(x, right) in &columns {
            let along = |row: usize| {
                let row = &image[row * width..(row + 1) * width];
                row[x] * (1.0 - right) + row[(x + 1).min(width - 1)] * right
            };
            out.push((along(y) * (1.0 - below) + along(next) * below) as f32);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A depth image of 1280 by 720 with rectangles (x, y, width, height, mm).
    fn depth(rectangles: &[(usize, usize, usize, usize, u16)]) -> Depth {
        let mut depth = Depth { width: 1280, height: 720, data: vec![0; 1280 * 720] };
        for &(x, y, w, h, mm) in rectangles {
            for row in y..y + h {
                depth.data[row * 1280 + x..row * 1280 + x + w].fill(mm);
            }
        }
        depth
    }

    #[test]
    fn the_nearest_large_thing_is_the_region() {
        let far_wall = (0, 0, 1280, 600, 900);
        let object = (600, 300, 120, 200, 500);
        let other = (100, 100, 300, 300, 600);
        let found = region(&depth(&[far_wall, other, object])).unwrap();
        // 5 % of 120 and 200 are 6 and 10, half on each side.
        assert_eq!(found.bounds, [597, 295, 723, 505]);
        assert_eq!(found.size, [210.0 / 720.0, 126.0 / 1280.0]);
        assert_eq!(found.image.len(), 112 * 112);
        assert!((found.image[56 * 112 + 56] - 500.0 / 700.0).abs() < 1e-6);
        assert_eq!(found.image[0], 0.0);
    }

    #[test]
    fn holes_are_closed_and_edges_clip() {
        // Gaps of 10 px, as the sensor leaves them, do not split the object.
        let halves = [(0, 0, 100, 100, 500), (0, 110, 100, 100, 500)];
        let found = region(&depth(&halves)).unwrap();
        assert_eq!(found.bounds, [0, 0, 102, 215]);
    }

    #[test]
    fn nothing_near_is_no_region() {
        for rectangles in [
            &[][..],
            &[(0, 0, 1280, 600, 700)],
            &[(300, 300, 120, 120, 500)],
            &[(300, 600, 300, 100, 500)],
        ] {
            assert_eq!(region(&depth(rectangles)), None, "{rectangles:?}");
        }
        let small = Depth { width: 1, height: 1, data: vec![5] };
        assert_eq!(region(&small), None);
    }

    #[test]
    fn resizing_is_linear_between_pixel_centres() {
        let ramp: Vec<f64> = (0..4 * 3).map(|i| f64::from(i % 4)).collect();
        let out = resize(&ramp, 4, 3, 8);
        // Positions -0.25, 0.25, 0.75, … of the source.
        assert_eq!(&out[..8], &[0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.0]);
    }
}
