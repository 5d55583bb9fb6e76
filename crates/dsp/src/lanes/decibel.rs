//! Decibels of rows.

use super::Row;
use crate::simd::vectorized;

/// `10 log10(max(amin, x)) - offset` of every value (`power` in, decibels out).
pub fn power_to_decibel(rows: &mut [Row], amin: f32, offset: f32) {
    vectorized(
        #[inline(always)]
        || {
            for row in rows {
                for x in &mut row.0 {
                    *x = decibel(x.max(amin)) - offset;
                }
            }
        },
    );
}

/// `10 log10(x)` of a normal positive number, within 3 units in the last place (of 1 below 1), in
/// operations that vectorise.
#[inline(always)]
pub(crate) fn decibel_double(x: f64) -> f64 {
    // 10 log10(2) split so that the product of the first part with an exponent is exact.
    const OCTAVE_HIGH: f64 = 6165.0 / 2048.0;
    const OCTAVE_LOW: f64 = 4.605_038_981_195_214e-5;
    const NEPER: f64 = 4.342_944_819_032_518;
    let (e, half) = logarithm(x);
    e * OCTAVE_HIGH + (e * OCTAVE_LOW + 2.0 * NEPER * half)
}

/// `(e, ln(m) / 2)` of a normal positive number `2^e m` with `m` in `[sqrt(1/2), sqrt(2))`, in operations
/// that vectorise: the series of the inverse hyperbolic tangent, whose first term left out is 1e-17 of
/// the sum.
#[inline(always)]
pub(crate) fn logarithm(x: f64) -> (f64, f64) {
    const ONE: u64 = 1.0f64.to_bits();
    // 2^52: the bits of its sum with a smaller whole number end with that number.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    let bits = x.to_bits();
    let sqrt_half = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    let biased = bits.wrapping_add(ONE.wrapping_sub(sqrt_half)) >> 52;
    let m = f64::from_bits(bits.wrapping_sub(biased << 52).wrapping_add(ONE));
    let e = f64::from_bits(WHOLE.to_bits() | biased) - (WHOLE + 1023.0);
    let f = (m - 1.0) / (m + 1.0);
    let square = f * f;
    let tail = (1..=10).rev().fold(0.0, |sum, k| sum * square + 1.0 / f64::from(2 * k + 1));
    (e, f + f * square * tail)
}

/// `10 log10(x)` of a normal positive number, within 2 units in the last place, in operations that
/// vectorise: `x = 2^e (1 + f)` with `1 + f` in `[sqrt(1/2), sqrt(2))`, then the minimax polynomial
/// of the Cephes library for `ln(1 + f)`.
#[inline(always)]
pub(crate) fn decibel(x: f32) -> f32 {
    // 10 log10(2) split so that the product of the first part with an exponent is exact.
    const OCTAVE_HIGH: f32 = 6165.0 / 2048.0;
    const OCTAVE_LOW: f32 = 4.605_039e-5;
    const NEPER: f32 = 4.342_944_8;
    const P: [f32; 9] = [
        7.037_683_6e-2,
        -1.151_461e-1,
        1.167_699_9e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_8e-1,
        2.000_071_5e-1,
        -2.499_999_4e-1,
        3.333_333e-1,
    ];
    let sqrt_half = std::f32::consts::FRAC_1_SQRT_2.to_bits();
    let bits = x.to_bits();
    let exponent = (bits.wrapping_sub(sqrt_half) as i32) >> 23;
    let f = f32::from_bits(bits.wrapping_sub((exponent << 23) as u32)) - 1.0;
    let tail = P.iter().skip(1).fold(P[0], |sum, c| sum * f + c);
    let square = f * f;
    let ln = f + (tail * f * square - 0.5 * square);
    let e = exponent as f32;
    e * OCTAVE_HIGH + (e * OCTAVE_LOW + NEPER * ln)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn double_decibels_agree_with_the_library() {
        let mut worst = 0.0_f64;
        let mut check = |x: f64| {
            let want = 10.0 * x.log10();
            worst = worst.max((decibel_double(x) - want).abs() / want.abs().max(1.0));
        };
        for i in 0..400_000_u32 {
            check(f64::from_bits(0x0010_0000_0000_0001 + u64::from(i) * 23_000_000_000_003));
            check(0.5 + f64::from(i) * 4e-6);
        }
        [1.0, f64::MAX, f64::MIN_POSITIVE, 1e-10, 1e-5].into_iter().for_each(&mut check);
        assert!(worst < 7e-16, "{worst}");
        assert_eq!(decibel_double(1.0), 0.0);
    }

    #[test]
    fn decibels_agree_with_double_precision() {
        let mut worst = 0.0_f64;
        for i in 0..2_000_000_u32 {
            let x = f32::from_bits(0x0080_0000 + i * 1060);
            let want = 10.0 * f64::from(x).log10();
            let error = (f64::from(decibel(x)) - want).abs();
            worst = worst.max(error / want.abs().max(1.0));
        }
        assert!(worst < 2.5e-7, "{worst}");
    }
}
