//! Tables of a transform.

use std::f64::consts::PI;

use crate::real::Real;

/// `exp(-2 pi i k / n)`.
pub(super) fn turn(k: usize, n: usize) -> [f64; 2] {
    let angle = -2.0 * PI * (k % n) as f64 / n as f64;
    [angle.cos(), angle.sin()]
}

pub(super) fn twiddles<T: Real, const R: usize>(size: usize, scale: f64) -> Vec<[[T; 2]; R]> {
    let column = |j| std::array::from_fn(|q| turn(j * q, size).map(|x| T::of(scale * x)));
    (0..size / R).map(column).collect()
}

/// Radices of the passes over `points` (8 or more) values: fours until the rest is eights.
pub(super) fn radices(points: usize) -> Vec<usize> {
    let bits = points.trailing_zeros() as usize;
    let fours = [0, 2, 1][bits % 3];
    [vec![4; fours], vec![8; (bits - 2 * fours) / 3]].concat()
}

/// Fills `position[p]` for the sub-transform that starts at `start` and holds the values
/// `offset, offset + stride, ...`.
pub(super) fn reversed(
    position: &mut [u32],
    radices: &[usize],
    start: usize,
    offset: usize,
    stride: usize,
) {
    let size: usize = radices.iter().product();
    match radices {
        // Leaves leave their output in natural order.
        [] | [_] => {
            for k in 0..size {
                position[offset + k * stride] = (start + k) as u32;
            }
        }
        [radix, rest @ ..] => {
            for q in 0..*radix {
                let start = start + q * size / radix;
                reversed(position, rest, start, offset + q * stride, stride * radix);
            }
        }
    }
}
