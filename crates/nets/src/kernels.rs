//! Loops over numbers, compiled for the machine's best instruction set and split over threads in
//! pieces of a fixed size, so that results do not depend on the number of threads.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Numbers of a piece.
const PIECE: usize = 1 << 16;

/// Runs `body`, compiled once for each supported instruction set and chosen at run time. Write it
/// as `#[inline(always)] || …`.
#[inline(always)]
pub(crate) fn vectorized<R>(body: impl FnOnce() -> R) -> R {
    Arch::new().dispatch(Body(body))
}

struct Body<F>(F);

impl<R, F: FnOnce() -> R> WithSimd for Body<F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> R {
        (self.0)()
    }
}

/// `to += from`.
pub(crate) fn add(to: &mut [f32], from: &[f32]) {
    to.par_chunks_mut(PIECE).zip(from.par_chunks(PIECE)).for_each(|(to, from)| {
        vectorized(
            #[inline(always)]
            || to.iter_mut().zip(from).for_each(|(t, f)| *t += f),
        );
    });
}

/// Multiplies every number.
pub(crate) fn scale(values: &mut [f32], factor: f32) {
    values.par_chunks_mut(PIECE).for_each(|piece| {
        vectorized(
            #[inline(always)]
            || piece.iter_mut().for_each(|v| *v *= factor),
        );
    });
}

/// Adds `bias` to every row.
pub(crate) fn add_to_rows(values: &mut [f32], bias: &[f32]) {
    let n = bias.len();
    values.par_chunks_mut(rows_per_piece(n) * n).for_each(|piece| {
        vectorized(
            #[inline(always)]
            || {
                for row in piece.chunks_exact_mut(n) {
                    row.iter_mut().zip(bias).for_each(|(v, b)| *v += b);
                }
            },
        );
    });
}

/// Negative numbers become zero.
pub(crate) fn relu(values: &mut [f32]) {
    values.par_chunks_mut(PIECE).for_each(|piece| {
        vectorized(
            #[inline(always)]
            || piece.iter_mut().for_each(|v| *v = if *v < 0.0 { 0.0 } else { *v }),
        );
    });
}

/// Zero where the output was not positive.
pub(crate) fn relu_backward(gradient: &mut [f32], output: &[f32]) {
    gradient.par_chunks_mut(PIECE).zip(output.par_chunks(PIECE)).for_each(|(g, y)| {
        vectorized(
            #[inline(always)]
            || g.iter_mut().zip(y).for_each(|(g, &y)| *g = if y > 0.0 { *g } else { 0.0 }),
        );
    });
}

/// Sums of each of `n` columns of what `row` makes of every row.
fn column_sums_of(values: &[f32], n: usize, each: impl Fn(&[f32], &mut [f64]) + Sync) -> Vec<f64> {
    let partial: Vec<Vec<f64>> = values
        .par_chunks(rows_per_piece(n) * n)
        .map(|piece| {
            let mut sums = vec![0.0f64; n];
            each(piece, &mut sums);
            sums
        })
        .collect();
    let mut sums = vec![0.0f64; n];
    for part in partial {
        sums.iter_mut().zip(part).for_each(|(s, p)| *s += p);
    }
    sums
}

/// Sum of each of `n` columns.
pub(crate) fn column_sums(values: &[f32], n: usize) -> Vec<f64> {
    column_sums_of(values, n, |piece, sums| {
        vectorized(
            #[inline(always)]
            || {
                for row in piece.chunks_exact(n) {
                    sums.iter_mut().zip(row).for_each(|(s, &v)| *s += f64::from(v));
                }
            },
        );
    })
}

/// Sum of squared differences from `center`, column by column.
pub(crate) fn column_squares(values: &[f32], center: &[f64]) -> Vec<f64> {
    let n = center.len();
    column_sums_of(values, n, |piece, sums| {
        vectorized(
            #[inline(always)]
            || {
                for row in piece.chunks_exact(n) {
                    for ((s, &v), c) in sums.iter_mut().zip(row).zip(center) {
                        let d = f64::from(v) - c;
                        *s += d * d;
                    }
                }
            },
        );
    })
}

/// Sum of products of two matrices, column by column.
pub(crate) fn column_products(a: &[f32], b: &[f32], n: usize) -> Vec<f64> {
    let rows = rows_per_piece(n) * n;
    let partial: Vec<Vec<f64>> = a
        .par_chunks(rows)
        .zip(b.par_chunks(rows))
        .map(|(a, b)| {
            let mut sums = vec![0.0f64; n];
            vectorized(
                #[inline(always)]
                || {
                    for (a, b) in a.chunks_exact(n).zip(b.chunks_exact(n)) {
                        for ((s, &a), &b) in sums.iter_mut().zip(a).zip(b) {
                            *s += f64::from(a) * f64::from(b);
                        }
                    }
                },
            );
            sums
        })
        .collect();
    let mut sums = vec![0.0f64; n];
    for part in partial {
        sums.iter_mut().zip(part).for_each(|(s, p)| *s += p);
    }
    sums
}

/// Sum of squares.
pub(crate) fn squares(values: &[f32]) -> f64 {
    let partial: Vec<f64> = values
        .par_chunks(PIECE)
        .map(|piece| {
            let mut lanes = [0.0f64; 16];
            vectorized(
                #[inline(always)]
                || {
                    let (whole, rest) = piece.as_chunks::<16>();
                    for row in whole {
                        lanes.iter_mut().zip(row).for_each(|(l, &v)| *l += f64::from(v).powi(2));
                    }
                    lanes.iter_mut().zip(rest).for_each(|(l, &v)| *l += f64::from(v).powi(2));
                },
            );
            lanes.iter().sum()
        })
        .collect();
    partial.iter().sum()
}

/// Rows of `n` numbers in a piece.
pub(crate) fn rows_per_piece(n: usize) -> usize {
    (PIECE / n.max(1)).max(1)
}

/// `e^x`, relative error below 2e-7; for use inside `vectorized`.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0; // 1.5 * 2^23: adding it rounds to an integer
    let x = x.clamp(-87.0, 88.0);
    let shifted = x * std::f32::consts::LOG2_E + MAGIC;
    let n = shifted - MAGIC;
    // ln 2 in two parts
    let r = x - n * 0.693_359_4 + n * 2.121_944_4e-4;
    let p = 1.987_569_1e-4;
    let p = p * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 0.166_666_65;
    let p = p * r + 0.5;
    let power = f32::from_bits(shifted.to_bits().wrapping_add(127) << 23);
    (p * r * r + r + 1.0) * power
}

/// Logistic function; for use inside `vectorized`.
#[inline(always)]
pub(crate) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Hyperbolic tangent, relative error below 3e-7; for use inside `vectorized`.
#[inline(always)]
pub(crate) fn tanh(x: f32) -> f32 {
    let z = x * x;
    let p = -5.704_988_7e-3;
    let p = p * z + 2.063_909e-2;
    let p = p * z - 5.373_971_6e-2;
    let p = p * z + 0.133_314_42;
    let p = p * z - 0.333_332_8;
    let small = x + x * z * p;
    let large = 1.0 - 2.0 / (exp(2.0 * x.abs()) + 1.0);
    let large = if x < 0.0 { -large } else { large };
    if x.abs() < 0.625 { small } else { large }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_are_exact_to_single_precision() {
        let mut worst = (0.0f64, 0.0f64, 0.0f64);
        for i in -870_000..=870_000 {
            let x = i as f32 * 1e-4;
            let wide = f64::from(x);
            let relative = |got: f32, want: f64| (f64::from(got) - want).abs() / want.abs();
            worst.0 = worst.0.max(relative(exp(x), wide.exp()));
            if x.abs() < 80.0 {
                worst.1 = worst.1.max(relative(sigmoid(x), 1.0 / (1.0 + (-wide).exp())));
            }
            if x != 0.0 {
                worst.2 = worst.2.max(relative(tanh(x), wide.tanh()));
            }
        }
        assert!(worst.0 < 2e-7 && worst.1 < 4e-7 && worst.2 < 3e-7, "{worst:?}");
        assert_eq!(tanh(0.0), 0.0);
    }

    #[test]
    fn sums_do_not_depend_on_the_number_of_threads() {
        let values: Vec<f32> =
            (0_u32..300_000).map(|i| ((i * 7919) % 1000) as f32 * 0.37).collect();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| (column_sums(&values, 3), squares(&values)))
        };
        assert_eq!(run(1), run(4));
    }
}
