//! Image resizing as scikit-image 0.26 `transform.resize` does it with linear interpolation.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};

use crate::error::{DspError, Result};
use crate::real::{Real, require_finite};
use crate::stft::PadMode;

/// How to resize.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResizeParams {
    /// Rows and columns of the result.
    pub shape: (usize, usize),
    /// What lies outside the image, in numpy's words (scikit-image's default is `reflect`).
    pub mode: PadMode,
    /// Gaussian smoothing before an axis shrinks; `None`: if any axis does.
    pub anti_aliasing: Option<bool>,
}

impl ResizeParams {
    /// scikit-image's defaults.
    pub fn new(rows: usize, columns: usize) -> Self {
        Self { shape: (rows, columns), mode: PadMode::Reflect, anti_aliasing: None }
    }
}

/// `image [rows, columns]` at another size (scikit-image `resize(order=1, cval=0, clip=True)`).
/// Sums run in double precision; each axis of the smoothing is rounded to `T`.
///
/// # Errors
/// An empty image or shape, or non-finite values.
pub fn resize<T: Real>(image: ArrayView2<T>, params: &ResizeParams) -> Result<Array2<T>> {
    let (rows, columns) = params.shape;
    if rows == 0 || columns == 0 {
        let value = format!("{rows} x {columns}");
        return Err(DspError::parameter("shape", value, "at least one row and one column"));
    }
    if image.is_empty() {
        let actual = image.shape().to_vec();
        return Err(DspError::Shape { name: "image", expected: "at least 1 x 1".into(), actual });
    }
    require_finite("image", image)?;
    let shrinks = rows < image.nrows() || columns < image.ncols();
    let mut smooth = image.to_owned();
    if params.anti_aliasing.unwrap_or(shrinks) {
        for (axis, size) in [rows, columns].into_iter().enumerate() {
            let factor = image.len_of(Axis(axis)) as f64 / size as f64;
            let sigma = ((factor - 1.0) / 2.0).max(0.0);
            if sigma > 1e-15 {
                let kernel = gaussian(sigma);
                along(&mut smooth, axis, |line| blur(line, &kernel, params.mode));
            }
        }
    }
    let across = taps(image.ncols(), columns);
    let down = taps(image.nrows(), rows);
    let value = |i: Option<usize>, j: Option<usize>| match (i, j) {
        (Some(i), Some(j)) => smooth[[i, j]].wide(),
        _ => 0.0,
    };
    let (n_rows, n_columns) = image.dim();
    let mut out = Array2::from_shape_fn((rows, columns), |(r, c)| {
        let ((i, fi), (j, fj)) = (down[r], across[c]);
        let row = |k| params.mode.index(i + k, n_rows);
        let column = |k| params.mode.index(j + k, n_columns);
        let line = |k| (1.0 - fj) * value(row(k), column(0)) + fj * value(row(k), column(1));
        T::of((1.0 - fi) * line(0) + fi * line(1))
    });
    clip(image, params.mode, &mut out);
    Ok(out)
}

/// Keeps the result in the range of the image; zeros from outside stay zeros.
fn clip<T: Real>(image: ArrayView2<T>, mode: PadMode, out: &mut Array2<T>) {
    let low = image.iter().copied().fold(T::infinity(), T::min);
    let high = image.iter().copied().fold(T::neg_infinity(), T::max);
    let keep_zero = mode == PadMode::Constant && !(low <= T::zero() && T::zero() <= high);
    out.mapv_inplace(|v| if keep_zero && v == T::zero() { v } else { v.max(low).min(high) });
}

/// For each output: the input position below its centre, and how far above that it lies.
fn taps(from: usize, to: usize) -> Vec<(isize, f64)> {
    let zoom = from as f64 / to as f64;
    (0..to)
        .map(|o| {
            let at = zoom * o as f64 + 0.5 * zoom - 0.5;
            (at.floor() as isize, at - at.floor())
        })
        .collect()
}

/// Right half of a Gaussian cut at four standard deviations, of unit sum over both halves.
fn gaussian(sigma: f64) -> Vec<f64> {
    let radius = (4.0 * sigma + 0.5) as usize;
    let half: Vec<f64> =
        (0..=radius).map(|i| (-0.5 / (sigma * sigma) * (i * i) as f64).exp()).collect();
    let total = 2.0 * half.iter().sum::<f64>() - half[0];
    half.iter().map(|w| w / total).collect()
}

fn along<T: Real>(
    image: &mut Array2<T>,
    axis: usize,
    filter: impl Fn(ArrayView1<T>) -> Array1<T>,
) {
    for mut line in image.lanes_mut(Axis(axis)) {
        let filtered = filter(line.view());
        line.assign(&filtered);
    }
}

fn blur<T: Real>(line: ArrayView1<T>, kernel: &[f64], mode: PadMode) -> Array1<T> {
    let at = |i: isize| mode.index(i, line.len()).map_or(0.0, |i| line[i].wide());
    Array1::from_shape_fn(line.len(), |i| {
        let i = i as isize;
        let sides = kernel.iter().enumerate().skip(1);
        let sum = sides.fold(kernel[0] * at(i), |sum, (j, w)| {
            sum + (at(i - j as isize) + at(i + j as isize)) * w
        });
        T::of(sum)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_stays_and_ramps_stay_straight() {
        let flat = Array2::from_elem((30, 7), -3.5f32);
        let out = resize(flat.view(), &ResizeParams::new(9, 20)).unwrap();
        assert!(out.iter().all(|&v| (v + 3.5).abs() < 1e-6));
        let ramp = Array2::from_shape_fn((8, 4), |(_, c)| c as f64);
        let params = ResizeParams { mode: PadMode::Edge, ..ResizeParams::new(8, 8) };
        let out = resize(ramp.view(), &params).unwrap();
        assert_eq!(out.row(3).to_vec(), [0.0, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.0]);
    }

    #[test]
    fn tiny_and_impossible() {
        let one = Array2::from_elem((1, 1), 2.0f32);
        assert_eq!(resize(one.view(), &ResizeParams::new(3, 3)).unwrap().sum(), 18.0);
        assert!(resize(one.view(), &ResizeParams::new(0, 3)).is_err());
        assert!(resize(Array2::<f32>::zeros((0, 3)).view(), &ResizeParams::new(2, 2)).is_err());
    }
}
