//! What the rise of mel bands from frame to frame is asked for.

use corsmal_dsp::mel::{MelNorm, MelParams};
use corsmal_dsp::onset::OnsetParams;
use corsmal_dsp::stft::StftParams;
use serde::{Deserialize, Serialize};

use crate::params::{Keys, MelSpec, StftSpec};

/// Bands, and how far back a frame is compared.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct RiseSpec {
    #[serde(flatten)]
    stft: StftSpec,
    #[serde(flatten)]
    mel: MelSpec,
    lag: usize,
    max_size: usize,
}

impl Default for RiseSpec {
    fn default() -> Self {
        Self { stft: StftSpec::default(), mel: MelSpec::default(), lag: 1, max_size: 1 }
    }
}

/// The parameters of a rise, checked.
pub struct Rise {
    pub stft: StftParams,
    pub mel: MelParams,
    pub onset: OnsetParams,
}

impl RiseSpec {
    /// What the keys mean.
    pub const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        MelSpec::KEYS,
        &[
            ("lag", "Frames to look back."),
            ("max_size", "Bands of the maximum filter over the earlier frame; 1: no filter."),
        ],
    ];

    /// The parameters for signals of `sr` Hz.
    ///
    /// # Errors
    /// Impossible values.
    pub fn params(&self, sr: f64) -> corsmal_dsp::Result<Rise> {
        let stft = self.stft.params()?;
        let defaults = OnsetParams::new(stft.n_fft, stft.hop_length)?;
        let onset = OnsetParams { lag: self.lag, max_size: self.max_size, ..defaults };
        onset.check()?;
        let mel = self.mel.params(sr, stft.n_fft, MelNorm::Slaney);
        Ok(Rise { stft, mel, onset })
    }
}
