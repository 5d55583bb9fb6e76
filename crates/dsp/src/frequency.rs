//! Frequencies of transform bins and on the octave scale (librosa 0.11 `core.convert`).

use crate::error::{DspError, Result};

/// Refuses sample rates that are not positive and finite.
pub fn require_rate(sr: f64) -> Result<()> {
    if sr.is_finite() && sr > 0.0 {
        Ok(())
    } else {
        Err(DspError::parameter("sr", sr, "a positive sample rate in Hz"))
    }
}

/// Centre frequencies in Hz of the `n_fft / 2 + 1` bins (`fft_frequencies`), rounded exactly as
/// `numpy.fft.rfftfreq` rounds them: comparisons with band edges depend on the last bit.
///
/// # Errors
/// `sr <= 0` or `n_fft = 0`.
pub fn fft_frequencies(sr: f64, n_fft: usize) -> Result<Vec<f64>> {
    require_rate(sr)?;
    if n_fft == 0 {
        return Err(DspError::parameter("n_fft", 0, "at least 1"));
    }
    let step = 1.0 / (n_fft as f64 * (1.0 / sr));
    Ok((0..=n_fft / 2).map(|k| k as f64 * step).collect())
}

/// Octaves above A0 = 27.5 Hz, shifted by `tuning` in fractions of a bin (`hz_to_octs`).
pub fn hz_to_octs(hz: f64, tuning: f64, bins_per_octave: usize) -> f64 {
    let a440 = 440.0 * 2.0_f64.powf(tuning / bins_per_octave as f64);
    (hz / (a440 / 16.0)).log2()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_reach_nyquist() {
        let f = fft_frequencies(22050.0, 16).unwrap();
        assert_eq!(f.len(), 9);
        assert_eq!(f[1], 1378.125);
        assert_eq!(f[8], 11025.0);
        assert!(fft_frequencies(0.0, 16).is_err());
        assert!(fft_frequencies(f64::NAN, 16).is_err());
    }

    #[test]
    fn concert_pitch_is_four_octaves_up() {
        assert_eq!(hz_to_octs(440.0, 0.0, 12), 4.0);
        let sharp = 440.0 * 2.0_f64.powf(0.25 / 12.0);
        assert!((hz_to_octs(sharp, 0.25, 12) - 4.0).abs() < 1e-12);
    }
}
