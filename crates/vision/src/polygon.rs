//! Polygons as masks.

use crate::mask::Mask;

/// Adds the pixels whose centres lie in a polygon (even-odd); a pixel covers 0 to 1.
pub(crate) fn fill(polygon: &[f32], mask: &mut Mask) {
    let points: Vec<(f64, f64)> =
        polygon.chunks_exact(2).map(|p| (f64::from(p[0]), f64::from(p[1]))).collect();
    let width = mask.width;
    let mut cuts = Vec::new();
    for (row, pixels) in mask.data.chunks_exact_mut(width).enumerate() {
        let y = row as f64 + 0.5;
        cuts.clear();
        for (i, &(x0, y0)) in points.iter().enumerate() {
            let (x1, y1) = points[(i + 1) % points.len()];
            if (y0 <= y) != (y1 <= y) {
                cuts.push(x0 + (y - y0) / (y1 - y0) * (x1 - x0));
            }
        }
        cuts.sort_by(f64::total_cmp);
        for pair in cuts.chunks_exact(2) {
            let edge = |x: f64| (x - 0.5).ceil().clamp(0.0, width as f64) as usize;
            let (from, to) = (edge(pair[0]), edge(pair[1]));
            pixels[from..to.max(from)].fill(true);
        }
    }
}
