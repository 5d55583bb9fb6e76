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

/// `10 log10(x)` of a normal positive number, within 2 units in the last place, in operations that
/// vectorise: `x = 2^e (1 + f)` with `1 + f` in `[sqrt(1/2), sqrt(2))`, then the minimax polynomial
/// of the Cephes library for `ln(1 + f)`.
#[inline(always)]
fn decibel(x: f32) -> f32 {
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
