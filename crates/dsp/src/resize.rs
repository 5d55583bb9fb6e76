//! Image resizing as scikit-image 0.26 `transform.resize` does it with linear interpolation.

use ndarray::{Array2, ArrayView2, s};

use crate::error::{DspError, Result};
use crate::real::{Real, require_all_finite};
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
    resize_extended(image, image.ncols(), params)
}

/// [`resize`] of an image of `n_columns` columns, of which `image` has the first: the others repeat its last.
///
/// # Errors
/// As [`resize`].
pub(crate) fn resize_extended<T: Real>(
    image: ArrayView2<T>,
    n_columns: usize,
    params: &ResizeParams,
) -> Result<Array2<T>> {
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
    require_all_finite("image", image.view())?;
    let (n_rows, known) = image.dim();
    let shrinks = rows < n_rows || columns < n_columns;
    let smooths = params.anti_aliasing.unwrap_or(shrinks);
    let kernel = |from, to| if smooths { gaussian(from, to) } else { vec![1.0] };
    // Only what the interpolation reads is smoothed: rows first, of them columns.
    let down = Taps::new(n_rows, rows, params.mode);
    let across = Taps::new(n_columns, columns, params.mode);
    let row = |i| params.mode.index(i, n_rows);
    let column = |i| params.mode.index(i, n_columns).map(|i| i.min(known - 1));
    let kept = down.read.len();
    let mut turned = vec![T::zero(); kept * known];
    let lines = Lines { values, width: known };
    smoothed(lines, &down.read, &kernel(n_rows, rows), row, &mut turned, Turn::About);
    let lines = Lines { values: &turned, width: kept };
    let mut smooth = vec![T::zero(); across.read.len() * kept];
    let kernel = kernel(n_columns, columns);
    smoothed(lines, &across.read, &kernel, column, &mut smooth, Turn::Not);
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

/// Lines of an image, one after another.
#[derive(Clone, Copy)]
struct Lines<'a, T> {
    values: &'a [T],
    /// Values of a line.
    width: usize,
}

/// Whether values are written line by line, or place by place.
#[derive(Clone, Copy, PartialEq)]
enum Turn {
    Not,
    About,
}

/// Places of a line that are summed together.
const CHUNK: usize = 32;

/// The lines `chosen` of an image, each a sum of its neighbours with the weights of a symmetric
/// `kernel`, into `out`; `line` says where one lies, or that it is zero.
fn smoothed<T: Real>(
    image: Lines<T>,
    chosen: &[usize],
    kernel: &[f64],
    line: impl Fn(isize) -> Option<usize>,
    out: &mut [T],
    turn: Turn,
) {
    let (width, zeros) = (image.width, [T::zero(); CHUNK]);
    let around = |i: usize| {
        let (i, reach) = (i as isize, kernel.len() as isize - 1);
        (i - reach..=i + reach).map(&line).collect()
    };
    let around: Vec<Vec<Option<usize>>> = chosen.iter().map(|i| around(*i)).collect();
    let mut part = vec![T::zero(); chosen.len() * CHUNK];
    for first in (0..width).step_by(CHUNK) {
        let count = CHUNK.min(width - first);
        vectorized(
            #[inline(always)]
            || {
                for (slots, around) in part.as_chunks_mut::<CHUNK>().0.iter_mut().zip(&around) {
                    let piece = |line: Option<usize>| match line {
                        Some(line) => &image.values[line * width + first..][..count],
                        None => &zeros[..count],
                    };
                    match count {
                        CHUNK => sum_around(slots, around, kernel, CHUNK, piece),
                        _ => sum_around(slots, around, kernel, count, piece),
                    }
                }
            },
        );
        match turn {
            Turn::Not => {
                for (line, part) in out.chunks_exact_mut(width).zip(part.chunks_exact(CHUNK)) {
                    line[first..first + count].copy_from_slice(&part[..count]);
                }
            }
            Turn::About => {
                let part = ArrayView2::from_shape((chosen.len(), CHUNK), &part);
                let part = part.expect("whole chunks").slice_move(s![.., ..count]);
                read_columns(part, &mut out[first * chosen.len()..]);
            }
        }
    }
}

/// `count` places of the sum of the lines `around` one.
#[inline(always)]
fn sum_around<'a, T: Real>(
    slots: &mut [T; CHUNK],
    around: &[Option<usize>],
    kernel: &[f64],
    count: usize,
    piece: impl Fn(Option<usize>) -> &'a [T],
) {
    let middle = kernel.len() - 1;
    let mut sums = [0.0; CHUNK];
    let centre = piece(around[middle]);
    for i in 0..count {
        sums[i] = kernel[0] * centre[i].wide();
    }
    for (j, w) in kernel.iter().enumerate().skip(1) {
        let (a, b) = (piece(around[middle - j]), piece(around[middle + j]));
        for i in 0..count {
            sums[i] += (a[i].wide() + b[i].wide()) * w;
        }
    }
    for i in 0..count {
        slots[i] = T::of(sums[i]);
    }
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
