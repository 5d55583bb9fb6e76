//! Borders of masks, followed as Suzuki and Abe (1985) do, and what polygons of them enclose.

use crate::mask::Mask;

/// A closed border: pixels (column, row), each a neighbour of the next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contour {
    /// The pixels of the border, in order.
    pub points: Vec<(i32, i32)>,
    /// The border of a hole: its pixels still belong to the mask.
    pub hole: bool,
}

/// The eight neighbours, clockwise on the screen from the right.
const AROUND: [(i32, i32); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// All borders of a mask whose pixels are neighbours in eight directions: outer ones and those of
/// holes, in the order of their first pixels, row by row.
pub fn contours(mask: &Mask) -> Vec<Contour> {
    let mut field = Field::new(mask);
    let mut found = Vec::new();
    for y in 0..mask.height {
        let mut left = 0i8;
        for x in 0..mask.width {
            let at = field.index(x, y);
            let here = field.labels[at];
            if here == 1 && left == 0 {
                found.push(field.follow(at, 4, false));
            } else if here > 0 && field.labels[at + 1] == 0 {
                found.push(field.follow(at, 0, true));
            }
            left = field.labels[at];
        }
    }
    found
}

/// Mask with a border of one pixel: 0 outside, 1 not yet followed, 2 followed, -2 followed with
/// nothing to its right.
struct Field {
    labels: Vec<i8>,
    stride: usize,
}

impl Field {
    fn new(mask: &Mask) -> Self {
        let stride = mask.width + 2;
        let mut labels = vec![0; stride * (mask.height + 2)];
        for (y, row) in mask.data.chunks_exact(mask.width).enumerate() {
            let start = (y + 1) * stride + 1;
            for (label, &inside) in labels[start..].iter_mut().zip(row) {
                *label = i8::from(inside);
            }
        }
        Self { labels, stride }
    }

    fn index(&self, x: usize, y: usize) -> usize {
        (y + 1) * self.stride + x + 1
    }

    fn point(&self, at: usize) -> (i32, i32) {
        ((at % self.stride) as i32 - 1, (at / self.stride) as i32 - 1)
    }

    fn neighbour(&self, at: usize, direction: usize) -> usize {
        let (dx, dy) = AROUND[direction % 8];
        // Labels have a border, so a neighbour of a labelled pixel always exists.
        (at as isize + dx as isize + dy as isize * self.stride as isize) as usize
    }

    /// Follows the border that starts at a pixel whose neighbour in a direction lies outside it.
    fn follow(&mut self, start: usize, outside: usize, hole: bool) -> Contour {
        let mut points = vec![self.point(start)];
        let first = (1..8).find(|turn| self.labels[self.neighbour(start, outside + turn)] != 0);
        let Some(first) = first else {
            self.labels[start] = -2;
            return Contour { points, hole };
        };
        let last = self.neighbour(start, outside + first);
        let (mut at, mut from) = (start, outside + first);
        loop {
            // Counter-clockwise from where we came; the first that belongs to the mask is next.
            let mut right_is_outside = false;
            let mut next = from;
            for turn in 1..=8 {
                next = from + 8 * 8 - turn;
                if self.labels[self.neighbour(at, next)] != 0 {
                    break;
                }
                right_is_outside |= next % 8 == 0;
            }
            if right_is_outside {
                self.labels[at] = -2;
            } else if self.labels[at] == 1 {
                self.labels[at] = 2;
            }
            let to = self.neighbour(at, next);
            if to == start && at == last {
                return Contour { points, hole };
            }
            points.push(self.point(to));
            from = (next + 4) % 8;
            at = to;
        }
    }
}

/// Area, and the coordinates of the centroid multiplied by it.
struct Moments {
    area: f64,
    x: f64,
    y: f64,
}

impl Contour {
    /// Area of the polygon through the centres of the border's pixels, in px².
    pub fn area(&self) -> f64 {
        self.moments().area
    }

    /// Centroid (column, row) of that polygon; `None` where it has no area.
    pub fn centroid(&self) -> Option<[f64; 2]> {
        let m = self.moments();
        (m.area > 0.0).then(|| [m.x / m.area, m.y / m.area])
    }

    /// Green's formula over the polygon, positive for either sense of rotation.
    fn moments(&self) -> Moments {
        let mut m = Moments { area: 0.0, x: 0.0, y: 0.0 };
        let next = self.points.iter().cycle().skip(1);
        for (&(x0, y0), &(x1, y1)) in self.points.iter().zip(next) {
            let cross = f64::from(x0) * f64::from(y1) - f64::from(x1) * f64::from(y0);
            m.area += cross / 2.0;
            m.x += cross * f64::from(x0 + x1) / 6.0;
            m.y += cross * f64::from(y0 + y1) / 6.0;
        }
        let sign = if m.area < 0.0 { -1.0 } else { 1.0 };
        Moments { area: sign * m.area, x: sign * m.x, y: sign * m.y }
    }

    /// First and last column, first and last row.
    pub fn bounds(&self) -> (i32, i32, i32, i32) {
        let start = (i32::MAX, i32::MIN, i32::MAX, i32::MIN);
        self.points
            .iter()
            .fold(start, |(l, r, t, b), &(x, y)| (l.min(x), r.max(x), t.min(y), b.max(y)))
    }

    /// The polygon and its border as a mask of a size.
    pub fn filled(&self, width: usize, height: usize) -> Mask {
        let mut crossings: Vec<Vec<i32>> = vec![Vec::new(); height];
        let mut mask = Mask::empty(width, height);
        let next = self.points.iter().cycle().skip(1);
        for (&(x0, y0), &(x1, y1)) in self.points.iter().zip(next) {
            if (0..height as i32).contains(&y0) && (0..width as i32).contains(&x0) {
                mask.data[y0 as usize * width + x0 as usize] = true;
            }
            // Neighbouring pixels: an edge crosses the one row it leaves or reaches from below.
            if y0 != y1 {
                let (top, x) = if y0 < y1 { (y0, x0) } else { (y1, x1) };
                if let Some(row) = usize::try_from(top).ok().and_then(|y| crossings.get_mut(y)) {
                    row.push(x);
                }
            }
        }
        for (row, cuts) in mask.data.chunks_exact_mut(width).zip(&mut crossings) {
            cuts.sort_unstable();
            for pair in cuts.chunks_exact(2) {
                let clip = |x: i32| x.clamp(0, width as i32 - 1) as usize;
                row[clip(pair[0])..=clip(pair[1])].fill(true);
            }
        }
        mask
    }
}

/// The border whose polygon is largest; the first of equals.
pub fn largest(mask: &Mask) -> Option<Contour> {
    let mut best: Option<(f64, Contour)> = None;
    for contour in contours(mask) {
        let area = contour.area();
        if best.as_ref().is_none_or(|(largest, _)| area > *largest) {
            best = Some((area, contour));
        }
    }
    best.map(|(_, contour)| contour)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::tests::drawn;

    #[test]
    fn a_ring_has_an_outer_border_and_one_of_its_hole() {
        let ring = drawn(&[".......", ".#####.", ".#...#.", ".#...#.", ".#####.", "......."]);
        let found = contours(&ring);
        assert_eq!(found.iter().map(|c| c.hole).collect::<Vec<_>>(), [false, true]);
        assert_eq!(found[0].bounds(), (1, 5, 1, 4));
        assert_eq!(found[0].area(), 12.0);
        let [x, y] = found[0].centroid().unwrap();
        assert!((x - 3.0).abs() < 1e-12 && (y - 2.5).abs() < 1e-12);
        assert_eq!(found[0].points.len(), 14);
        assert_eq!(found[0].filled(7, 6).area(), 20);
        // Corners of the hole are cut: the border of a hole is joined in eight directions.
        assert_eq!(found[1].points.len(), 10);
        assert_eq!(found[1].filled(7, 6).area(), 16);
        assert_eq!(largest(&ring), Some(found[0].clone()));
    }

    #[test]
    fn points_lines_and_edges_of_the_image() {
        let found = contours(&drawn(&["#..", "..#", "..."]));
        assert_eq!(found.len(), 2);
        assert!(found.iter().all(|c| c.points.len() == 1 && c.centroid().is_none()));
        let line = contours(&drawn(&["###", "...", "..."]));
        assert_eq!(line[0].points, [(0, 0), (1, 0), (2, 0), (1, 0)]);
        assert_eq!(line[0].area(), 0.0);
        assert_eq!(line[0].filled(3, 3).area(), 3);
        let full = contours(&drawn(&["###", "###", "###"]));
        assert_eq!((full.len(), full[0].area()), (1, 4.0));
        assert_eq!(largest(&Mask::empty(4, 4)), None);
    }

    proptest::proptest! {
        #[test]
        fn filling_the_outer_borders_covers_a_mask(bits in proptest::collection::vec(proptest::bool::weighted(0.6), 96)) {
            let mask = Mask { width: 12, height: 8, data: bits };
            let mut covered = Mask::empty(12, 8);
            for contour in contours(&mask) {
                // Every border pixel belongs to the mask.
                for &(x, y) in &contour.points {
                    proptest::prop_assert!(mask.data[y as usize * 12 + x as usize]);
                }
                if !contour.hole {
                    let filled = contour.filled(12, 8);
                    covered.data.iter_mut().zip(&filled.data).for_each(|(a, &b)| *a |= b);
                }
            }
            for (i, &inside) in mask.data.iter().enumerate() {
                proptest::prop_assert!(!inside || covered.data[i], "pixel {i}");
            }
        }
    }
}
