//! Mel filter banks.

use corsmal_dsp::mel::{MelNorm, MelParams};
use serde::{Deserialize, Serialize};

use super::keys::Keys;

/// Mel filter bank, its norm apart (librosa calls that `norm` or `mel_norm`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MelSpec {
    /// Number of bands.
    pub n_mels: usize,
    /// Lowest frequency in Hz.
    pub fmin: f64,
    /// Highest frequency in Hz; 0 is half the sample rate.
    pub fmax: f64,
    /// HTK's formula instead of Slaney's.
    pub htk: bool,
}

impl Default for MelSpec {
    fn default() -> Self {
        Self { n_mels: 128, fmin: 0.0, fmax: 0.0, htk: false }
    }
}

impl MelSpec {
    /// Parameters for a sample rate and transform length.
    pub fn params(&self, sr: f64, n_fft: usize, norm: MelNorm) -> MelParams {
        let fmax = (self.fmax != 0.0).then_some(self.fmax);
        MelParams { sr, n_fft, n_mels: self.n_mels, fmin: self.fmin, fmax, htk: self.htk, norm }
    }
}

impl MelSpec {
    /// What its keys mean.
    pub const KEYS: Keys = &[
        ("n_mels", "Number of mel bands."),
        ("fmin", "Lowest frequency of the bands in Hz."),
        ("fmax", "Highest frequency of the bands in Hz; 0: half the sample rate."),
        ("htk", "true: HTK's formula for mel; false: Slaney's, librosa's default."),
    ];
}
