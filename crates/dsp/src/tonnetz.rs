//! Tonal centroids (librosa 0.11 `feature.tonnetz`, after Harte et al. 2006).

use std::f64::consts::PI;

use ndarray::{Array2, Array3, ArrayView3};

use crate::columns::map_columns;
use crate::error::{DspError, Result};
use crate::normalize::Norm;
use crate::real::{Real, require_finite};

/// Coordinates of a tonal centroid: fifths, minor thirds, major thirds, each as (x, y).
pub const DIMENSIONS: usize = 6;

/// The matrix `[6, n_chroma]` of the pitch classes' places on the three circles.
fn circles(n_chroma: usize) -> Array2<f64> {
    const STEPS: [f64; 3] = [7.0 / 6.0, 3.0 / 2.0, 2.0 / 3.0];
    const RADII: [f64; 3] = [1.0, 1.0, 0.5];
    Array2::from_shape_fn((DIMENSIONS, n_chroma), |(d, c)| {
        let class = 12.0 * c as f64 / n_chroma as f64;
        let quarter = if d % 2 == 0 { 0.5 } else { 0.0 };
        RADII[d / 2] * (PI * (STEPS[d / 2] * class - quarter)).cos()
    })
}

/// Tonal centroids `[channels, 6, frames]` of a chromagram `[channels, n_chroma, frames]`, in double
/// precision whatever the input, as librosa returns them. Silence is 0.
///
/// # Errors
/// No pitch classes, or values that are not finite.
pub fn tonnetz<T: Real>(chroma: ArrayView3<T>) -> Result<Array3<f64>> {
    let n_chroma = chroma.dim().1;
    if n_chroma == 0 {
        let actual = chroma.shape().to_vec();
        return Err(DspError::Shape { name: "chroma", expected: "pitch classes".into(), actual });
    }
    require_finite("chroma", chroma)?;
    let circles = circles(n_chroma);
    let mut unit = vec![T::zero(); n_chroma];
    Ok(map_columns(chroma, DIMENSIONS, |_, _, frame, out: &mut [f64]| {
        unit.copy_from_slice(frame);
        Norm::P(1.0).normalize(&mut unit);
        for (out, circle) in out.iter_mut().zip(circles.rows()) {
            *out = circle.iter().zip(&unit).map(|(c, x)| c * x.wide()).sum();
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_classes_lie_on_the_circles() {
        let mut chroma = Array3::<f32>::zeros((1, 12, 13));
        (0..12).for_each(|k| chroma[[0, k, k]] = 3.0);
        let t = tonnetz(chroma.view()).unwrap();
        for k in 0..12 {
            let radius = |d: usize| t[[0, d, k]].hypot(t[[0, d + 1, k]]);
            assert!((radius(0) - 1.0).abs() < 1e-12 && (radius(4) - 0.5).abs() < 1e-12);
        }
        // The last frame is silent.
        assert!((0..6).all(|d| t[[0, d, 12]] == 0.0));
    }

    #[test]
    fn fifths_are_neighbours() {
        let phi = circles(12);
        let distance =
            |a: usize, b: usize| (phi[[0, a]] - phi[[0, b]]).hypot(phi[[1, a]] - phi[[1, b]]);
        assert!(distance(0, 7) < distance(0, 2) && distance(0, 2) < distance(0, 1));
    }
}
