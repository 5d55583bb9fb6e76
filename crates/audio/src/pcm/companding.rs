//! ITU-T G.711: the 256 values of A-law and mu-law, scaled as 16-bit samples.

/// A-law codes to samples.
pub(crate) static ALAW: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut code = 0;
    while code < 256 {
        // Even bits are transmitted inverted.
        let c = code as u8 ^ 0x55;
        let (exponent, mantissa) = ((c >> 4) & 7, (c & 15) as i32);
        let magnitude = match exponent {
            0 => (mantissa << 4) + 8,
            e => ((mantissa << 4) + 0x108) << (e - 1),
        };
        table[code] = scaled(if c & 0x80 != 0 { magnitude } else { -magnitude });
        code += 1;
    }
    table
};

/// mu-law codes to samples.
pub(crate) static MULAW: [f32; 256] = {
    const BIAS: i32 = 0x84;
    let mut table = [0.0; 256];
    let mut code = 0;
    while code < 256 {
        // All bits are transmitted inverted.
        let c = !(code as u8);
        let (exponent, mantissa) = ((c >> 4) & 7, (c & 15) as i32);
        let magnitude = (((mantissa << 3) + BIAS) << exponent) - BIAS;
        table[code] = scaled(if c & 0x80 != 0 { -magnitude } else { magnitude });
        code += 1;
    }
    table
};

const fn scaled(v: i32) -> f32 {
    v as f32 / 32768.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_and_zero_are_those_of_the_recommendation() {
        // G.711 tables 1 and 2, as 16-bit values: A-law 4032 * 8, mu-law 8031 * 4.
        assert_eq!(ALAW[0xaa], 32256.0 / 32768.0);
        assert_eq!(ALAW[0x2a], -32256.0 / 32768.0);
        assert_eq!(ALAW[0xd5], 8.0 / 32768.0);
        assert_eq!(MULAW[0x80], 32124.0 / 32768.0);
        assert_eq!(MULAW[0x00], -32124.0 / 32768.0);
        assert_eq!(MULAW[0xff], 0.0);
    }

    #[test]
    fn both_laws_are_odd_and_monotonic() {
        for (table, mask) in [(&ALAW, 0x55), (&MULAW, 0xff)] {
            let value = |magnitude: usize, sign: usize| table[(magnitude | sign) ^ mask];
            for m in 0..128 {
                assert_eq!(value(m, 0), -value(m, 0x80));
                assert!(m == 0 || value(m, 0).abs() > value(m - 1, 0).abs());
            }
        }
    }
}
