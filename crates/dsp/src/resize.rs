//! Image resizing as scikit-image 0.26 `transform.resize` does it with linear interpolation.

use ndarray::{Array2, ArrayView2};

use crate::error::{DspError, Result};
use crate::real::{Real, part_finite, require_finite};
use crate::simd::vectorized;
use crate::stft::PadMode;
use crate::tiles::read_columns;

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
    let image = image.as_standard_layout();
    let values = image.as_slice().expect("contiguous");
    if !part_finite(values) {
        require_finite("image", image.view())?;
    }
    let (n_rows, n_columns) = image.dim();
    let shrinks = rows < n_rows || columns < n_columns;
    let smooths = params.anti_aliasing.unwrap_or(shrinks);
    let kernel = |from, to| if smooths { gaussian(from, to) } else { vec![1.0] };
    // Only what the interpolation reads is smoothed: rows first, of them columns.
    let down = Taps::new(n_rows, rows, params.mode);
    let across = Taps::new(n_columns, columns, params.mode);
    let part = smoothed(values, n_columns, &down.read, &kernel(n_rows, rows), params.mode);
    let kept = down.read.len();
    let mut turned = vec![T::zero(); part.len()];
    let part = ArrayView2::from_shape((kept, n_columns), &part).expect("lines of equal length");
    read_columns(part, &mut turned);
    let kernel = kernel(n_columns, columns);
    let smooth = smoothed(&turned, kept, &across.read, &kernel, params.mode);
    let value = |row: Option<usize>, column: Option<usize>| match (row, column) {
        (Some(row), Some(column)) => smooth[column * kept + row].wide(),
        _ => 0.0,
    };
    let mut out = Array2::from_shape_fn((rows, columns), |(r, c)| {
        let (([top, bottom], fi), ([left, right], fj)) = (down.places[r], across.places[c]);
        let line = |row| (1.0 - fj) * value(row, left) + fj * value(row, right);
        T::of((1.0 - fi) * line(top) + fi * line(bottom))
    });
    clip(values, params.mode, &mut out);
    Ok(out)
}

/// Keeps the result in the range of the image; zeros from outside stay zeros.
fn clip<T: Real>(image: &[T], mode: PadMode, out: &mut Array2<T>) {
    let (low, high) = range(image);
    let keep_zero = mode == PadMode::Constant && !(low <= T::zero() && T::zero() <= high);
    out.mapv_inplace(|v| if keep_zero && v == T::zero() { v } else { v.max(low).min(high) });
}

/// The smallest and the largest of finite `values`.
fn range<T: Real>(values: &[T]) -> (T, T) {
    const WIDTH: usize = 32;
    let (mut low, mut high) = ([T::infinity(); WIDTH], [T::neg_infinity(); WIDTH]);
    vectorized(
        #[inline(always)]
        || {
            for values in values.chunks(WIDTH) {
                for ((low, high), x) in low.iter_mut().zip(&mut high).zip(values) {
                    *low = if *x < *low { *x } else { *low };
                    *high = if *x > *high { *x } else { *high };
                }
            }
        },
    );
    (low.into_iter().fold(T::infinity(), T::min), high.into_iter().fold(T::neg_infinity(), T::max))
}

/// What an axis of the result reads of the image.
struct Taps {
    /// Lines of the image, each once.
    read: Vec<usize>,
    /// For each output the places in `read` of the lines around its centre (`None`: a zero
    /// outside the image), and how far it lies from the first to the second.
    places: Vec<([Option<usize>; 2], f64)>,
}

impl Taps {
    fn new(from: usize, to: usize, mode: PadMode) -> Self {
        let zoom = from as f64 / to as f64;
        let (mut read, mut known) = (Vec::new(), vec![None; from]);
        let places = (0..to).map(|o| {
            let at = zoom * o as f64 + 0.5 * zoom - 0.5;
            let place = |line| {
                mode.index(line, from).map(|line| {
                    *known[line].get_or_insert_with(|| {
                        read.push(line);
                        read.len() - 1
                    })
                })
            };
            let first = at.floor() as isize;
            ([first, first + 1].map(place), at - at.floor())
        });
        let places = places.collect();
        Self { read, places }
    }
}

/// Right half of a Gaussian that keeps `to` of `from` lines from aliasing, cut at four standard
/// deviations, of unit sum over both halves; one weight where nothing is to smooth.
fn gaussian(from: usize, to: usize) -> Vec<f64> {
    let sigma = ((from as f64 / to as f64 - 1.0) / 2.0).max(0.0);
    if sigma <= 1e-15 {
        return vec![1.0];
    }
    let radius = (4.0 * sigma + 0.5) as usize;
    let half: Vec<f64> =
        (0..=radius).map(|i| (-0.5 / (sigma * sigma) * (i * i) as f64).exp()).collect();
    let total = 2.0 * half.iter().sum::<f64>() - half[0];
    half.iter().map(|w| w / total).collect()
}

/// The lines `chosen` of an image, one after another, each a sum of its neighbours with the weights
/// of a symmetric `kernel`. Lines have `width` values.
fn smoothed<T: Real>(
    image: &[T],
    width: usize,
    chosen: &[usize],
    kernel: &[f64],
    mode: PadMode,
) -> Vec<T> {
    let count = image.len() / width;
    let zeros = vec![T::zero(); width];
    let line =
        |i: isize| mode.index(i, count).map_or(&zeros[..], |i| &image[i * width..(i + 1) * width]);
    let mut out = vec![T::zero(); chosen.len() * width];
    let mut sums = vec![0.0; width];
    for (slots, &i) in out.chunks_exact_mut(width).zip(chosen) {
        let i = i as isize;
        vectorized(
            #[inline(always)]
            || {
                let centre = kernel[0];
                sums.iter_mut().zip(line(i)).for_each(|(sum, x)| *sum = centre * x.wide());
                for (j, w) in kernel.iter().enumerate().skip(1) {
                    let sides = line(i - j as isize).iter().zip(line(i + j as isize));
                    for (sum, (a, b)) in sums.iter_mut().zip(sides) {
                        *sum += (a.wide() + b.wide()) * w;
                    }
                }
                slots.iter_mut().zip(&sums).for_each(|(slot, sum)| *slot = T::of(*sum));
            },
        );
    }
    out
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

    /// The whole image smoothed, then interpolated, value by value.
    fn by_definition(image: &Array2<f64>, p: &ResizeParams) -> Array2<f64> {
        let blur = |image: &Array2<f64>, kernel: &[f64], (di, dj): (isize, isize)| {
            let (n, m) = image.dim();
            let at = |i, j| match (p.mode.index(i, n), p.mode.index(j, m)) {
                (Some(i), Some(j)) => image[[i, j]],
                _ => 0.0,
            };
            Array2::from_shape_fn((n, m), |(i, j)| {
                let (i, j) = (i as isize, j as isize);
                let sides = kernel.iter().enumerate().skip(1);
                sides.fold(kernel[0] * at(i, j), |sum, (k, w)| {
                    let k = k as isize;
                    sum + (at(i - k * di, j - k * dj) + at(i + k * di, j + k * dj)) * w
                })
            })
        };
        let (rows, columns) = p.shape;
        let smooth = blur(image, &gaussian(image.nrows(), rows), (1, 0));
        let smooth = blur(&smooth, &gaussian(image.ncols(), columns), (0, 1));
        let at = |i, j| match (p.mode.index(i, image.nrows()), p.mode.index(j, image.ncols())) {
            (Some(i), Some(j)) => smooth[[i, j]],
            _ => 0.0,
        };
        let place = |o: usize, from: usize, to: usize| {
            let zoom = from as f64 / to as f64;
            let at = zoom * o as f64 + 0.5 * zoom - 0.5;
            (at.floor() as isize, at - at.floor())
        };
        let mut out = Array2::from_shape_fn((rows, columns), |(r, c)| {
            let (i, fi) = place(r, image.nrows(), rows);
            let (j, fj) = place(c, image.ncols(), columns);
            let line = |i| (1.0 - fj) * at(i, j) + fj * at(i, j + 1);
            (1.0 - fi) * line(i) + fi * line(i + 1)
        });
        clip(image.as_slice().unwrap(), p.mode, &mut out);
        out
    }

    #[test]
    fn what_is_read_is_all_that_is_needed() {
        let image = Array2::from_shape_fn((57, 230), |(i, j)| ((i * 37 + j * 101) % 89) as f64);
        for mode in [PadMode::Reflect, PadMode::Symmetric, PadMode::Edge, PadMode::Constant] {
            for shape in [(19, 31), (57, 12), (5, 230), (96, 96), (1, 1)] {
                let params = ResizeParams { shape, mode, anti_aliasing: Some(true) };
                let want = by_definition(&image, &params);
                assert_eq!(resize(image.view(), &params).unwrap(), want, "{params:?}");
                let turned = image.t().as_standard_layout().into_owned();
                assert_eq!(resize(turned.t(), &params).unwrap(), want);
            }
        }
    }

    #[test]
    fn tiny_and_impossible() {
        let one = Array2::from_elem((1, 1), 2.0f32);
        assert_eq!(resize(one.view(), &ResizeParams::new(3, 3)).unwrap().sum(), 18.0);
        assert!(resize(one.view(), &ResizeParams::new(0, 3)).is_err());
        assert!(resize(Array2::<f32>::zeros((0, 3)).view(), &ResizeParams::new(2, 2)).is_err());
    }
}
