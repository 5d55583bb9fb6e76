//! Binary logarithm in single precision, rounded as numpy's vector code rounds it.

/// For each sixteenth of the mantissa in [1, 2) the cubic, highest degree first, that
/// approximates `log2(1 + r) / r` best in the maximum norm (found by the Remez exchange); mantissas
/// from 1.5 on are halved, so that `r` lies in [-0.25, 0.5).
const CUBICS: [[f32; 4]; 16] = [
    [-0.32713538, 0.47962224, -0.72133183, 1.442695],
    [-0.27086058, 0.46928123, -0.72067106, 1.4426804],
    [-0.22655562, 0.45282358, -0.7186117, 1.4425936],
    [-0.19122967, 0.43307126, -0.7149131, 1.4423616],
    [-0.16274084, 0.4117956, -0.70960295, 1.4419187],
    [-0.13952868, 0.39010483, -0.7028353, 1.4412137],
    [-0.12043882, 0.36868426, -0.6948141, 1.4402113],
    [-0.104605265, 0.34794682, -0.685753, 1.4388905],
    [-0.844945, 0.27969053, -0.75549436, 1.4405935],
    [-0.7441502, 0.34596437, -0.7409568, 1.4416573],
    [-0.6584921, 0.39425117, -0.73187304, 1.4422276],
    [-0.58525795, 0.42866543, -0.72647345, 1.4425105],
    [-0.5222953, 0.45234758, -0.7234966, 1.4426355],
    [-0.46788168, 0.46771082, -0.72204405, 1.4426814],
    [-0.42062804, 0.4766208, -0.7214783, 1.4426936],
    [-0.3794061, 0.48052752, -0.72134984, 1.442695],
];

/// `log2(x)` of a positive number.
///
/// A tuning is the fullest cell of a histogram of residues of this logarithm, so its last bit can
/// decide. Intel's routine behind numpy (AVX-512) evaluates such cubics by fused multiply-adds;
/// doing the same agrees with it in every bit, where a correctly rounded logarithm differs in one
/// value of forty.
pub fn log2(x: f32) -> f32 {
    if !x.is_normal() || x < 0.0 {
        return x.log2();
    }
    let bits = x.to_bits();
    let fraction = bits & 0x007f_ffff;
    let upper = bits & 0x0040_0000 != 0;
    let exponent = (bits >> 23) as i32 - 127 + i32::from(upper);
    let biased = if upper { 126 } else { 127 };
    let r = f32::from_bits(biased << 23 | fraction) - 1.0;
    // A product of two f32 is exact in double precision: one rounding, as in a fused operation.
    let fused = |p: f32, c: f32| (f64::from(p) * f64::from(r) + f64::from(c)) as f32;
    let [c3, c2, c1, c0] = CUBICS[(fraction >> 19) as usize];
    fused(fused(fused(fused(c3, c2), c1), c0), exponent as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_are_exact() {
        for e in -126..=127 {
            assert_eq!(log2(2.0_f32.powi(e)), e as f32);
        }
    }

    #[test]
    fn error_stays_within_two_units_in_the_last_place() {
        let mut x = 1.0e-20_f32;
        while x < 1e20 {
            let (got, want) = (log2(x), f64::from(x).log2());
            let unit = f64::from(f32::EPSILON) * want.abs().max(0.25);
            assert!((f64::from(got) - want).abs() <= 2.0 * unit, "{x}: {got} for {want}");
            x *= 1.000_37;
        }
    }

    #[test]
    fn last_bit_as_numpy_rounds_it() {
        // Measured with numpy 2.4 on a processor with AVX-512; the nearest value is one lower.
        assert_eq!(log2(21.810_402), 4.446_944_7);
        assert_ne!(21.810_402_f64.log2() as f32, 4.446_944_7);
    }

    #[test]
    fn other_numbers_are_left_to_the_library() {
        assert_eq!(log2(f32::INFINITY), f32::INFINITY);
        assert_eq!(log2(0.0), f32::NEG_INFINITY);
        assert!(log2(-1.0).is_nan() && log2(f32::NAN).is_nan());
        assert_eq!(log2(1e-45), -149.0);
    }
}
