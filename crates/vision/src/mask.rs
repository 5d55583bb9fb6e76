//! Masks: which pixels show an object.

/// Which pixels belong to an object, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height * width` values.
    pub data: Vec<bool>,
}

impl Mask {
    /// A mask without any pixel.
    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, data: vec![false; width * height] }
    }

    /// Number of pixels inside.
    pub fn area(&self) -> usize {
        self.data.iter().filter(|&&inside| inside).count()
    }

    /// First column, first row, column and row after the last; `None` without any pixel inside.
    pub fn bounds(&self) -> Option<[usize; 4]> {
        let inside = |row: &[bool]| row.contains(&true);
        let rows = self.data.chunks_exact(self.width);
        let top = rows.clone().position(inside)?;
        let bottom = rows.clone().rposition(inside)?;
        let mut columns = [self.width, 0];
        for row in rows {
            let (left, right) = (row.iter().position(|&p| p), row.iter().rposition(|&p| p));
            columns[0] = columns[0].min(left.unwrap_or(self.width));
            columns[1] = columns[1].max(right.map_or(0, |last| last + 1));
        }
        Some([columns[0], top, columns[1], bottom + 1])
    }

    /// Grows by one pixel in all eight directions.
    pub fn dilated(&self) -> Self {
        self.windowed(1, |a, b| a | b, false)
    }

    /// Shrinks by one pixel in all eight directions; what lies outside the image does not count.
    pub fn eroded(&self) -> Self {
        self.windowed(1, |a, b| a & b, true)
    }

    /// Closes gaps: the largest, then the smallest value of square windows with `2 * reach + 1` pixels
    /// a side. What lies outside the image does not count.
    pub fn closed(&self, reach: usize) -> Self {
        self.windowed(reach, |a, b| a | b, false).windowed(reach, |a, b| a & b, true)
    }

    /// Rows, then columns; `join` is "and" or "or", `neutral` does not change it.
    fn windowed(&self, reach: usize, join: impl Fn(bool, bool) -> bool, neutral: bool) -> Self {
        let (width, height) = (self.width, self.height);
        let mut rows = vec![neutral; self.data.len()];
        for (row, out) in self.data.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
            // Running distance to the last pixel that decides.
            run(row.iter(), out.iter_mut(), reach, neutral);
            run(row.iter().rev(), out.iter_mut().rev(), reach, neutral);
        }
        let mut data = rows.clone();
        for shift in 1..=reach.min(height - 1) {
            for (r, out) in data.chunks_exact_mut(width).enumerate() {
                for other in [r.checked_sub(shift), Some(r + shift).filter(|&o| o < height)] {
                    let Some(other) = other else { continue };
                    let from = &rows[other * width..(other + 1) * width];
                    for (a, &b) in out.iter_mut().zip(from) {
                        *a = join(*a, b);
                    }
                }
            }
        }
        Self { width, height, data }
    }
}

/// Marks the pixels at most `reach` after a pixel that is not neutral.
fn run<'a>(
    input: impl Iterator<Item = &'a bool>,
    output: impl Iterator<Item = &'a mut bool>,
    reach: usize,
    neutral: bool,
) {
    let mut since = usize::MAX;
    for (&pixel, out) in input.zip(output) {
        since = if pixel != neutral { 0 } else { since.saturating_add(1) };
        if since <= reach {
            *out = !neutral;
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A mask from rows of `#` and other characters.
    pub(crate) fn drawn(rows: &[&str]) -> Mask {
        let data = rows.iter().flat_map(|row| row.chars().map(|c| c == '#')).collect();
        Mask { width: rows[0].len(), height: rows.len(), data }
    }

    #[test]
    fn growing_shrinking_and_closing() {
        let dot = drawn(&[".....", ".....", "..#..", ".....", "....."]);
        assert_eq!(dot.dilated(), drawn(&[".....", ".###.", ".###.", ".###.", "....."]));
        assert_eq!(dot.dilated().eroded(), dot);
        assert_eq!(dot.eroded().area(), 0);
        assert_eq!((dot.dilated().bounds(), dot.eroded().bounds()), (Some([1, 1, 4, 4]), None));
        let gap = drawn(&["##.##", "##.##", "##.##"]);
        assert_eq!(gap.closed(1).area(), 15);
        // The edge of the image does not shrink a mask.
        let corner = drawn(&["##...", "##...", "....."]);
        assert_eq!(corner.eroded(), drawn(&["#....", ".....", "....."]));
    }

    #[test]
    fn windows_equal_the_plain_definition() {
        let mut state = 7u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 30 == 0
        };
        let (width, height, reach) = (23, 17, 3usize);
        let mask = Mask { width, height, data: (0..width * height).map(|_| random()).collect() };
        let grown = mask.windowed(reach, |a, b| a | b, false);
        for y in 0..height {
            for x in 0..width {
                let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
                let any = rows.flat_map(|v| {
                    (x.saturating_sub(reach)..(x + reach + 1).min(width)).map(move |u| (u, v))
                });
                let expected = any.into_iter().any(|(u, v)| mask.data[v * width + u]);
                assert_eq!(grown.data[y * width + x], expected, "{x}, {y}");
            }
        }
    }
}
