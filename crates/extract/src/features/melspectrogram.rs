//! `melspectrogram`: power in mel bands, linear or in decibels (log-mel).

use corsmal_dsp::mel::MelNorm;
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, Kernel, Quantity};
use super::kind::FeatureKind;
use super::labels::indices;
use super::mel_bands::{DecibelFinish, MelKernel};
use crate::params::{DbSpec, Keys, MelSpec, Scale, StftSpec};

/// Parameters of `melspectrogram`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Melspectrogram {
    #[serde(flatten)]
    stft: StftSpec,
    power: f64,
    #[serde(flatten)]
    mel: MelSpec,
    norm: MelNorm,
    scale: Scale,
    #[serde(flatten)]
    db: DbSpec,
}

impl Default for Melspectrogram {
    fn default() -> Self {
        Self {
            stft: StftSpec::default(),
            power: 2.0,
            mel: MelSpec::default(),
            norm: MelNorm::Slaney,
            scale: Scale::Linear,
            db: DbSpec::default(),
        }
    }
}

impl FeatureKind for Melspectrogram {
    const KIND: &'static str = "melspectrogram";
    const ABOUT: &'static str = "Power (power = 2) or magnitude (power = 1) in n_mels mel bands \
        (librosa.feature.melspectrogram); scale = power_to_db gives log-mel in dB, clamped top_db \
        below the maximum of each channel (joint = true: of all channels, as librosa does).";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        MelSpec::KEYS,
        Scale::KEYS,
        DbSpec::KEYS,
        &[
            ("power", "Exponent of the magnitudes before the bands: 2 is power, 1 magnitude."),
            (
                "norm",
                "Weight of the bands: slaney (equal area), none, or a number p for the p-norm.",
            ),
        ],
    ];
    const PYTHON: &'static str = "feature.melspectrogram";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        let params = self.mel.params(sr, stft.n_fft, self.norm);
        let quantity = quantity_of(self.power)?;
        let kernel = MelKernel::new(&params, self.scale, self.db.decibel(self.scale)?)?;
        let kernel = Kernel::Spectrum(stft, quantity, Box::new(kernel));
        Ok(Feature {
            finish: DecibelFinish::of(self.scale, &self.db, self.mel.n_mels),
            ..Feature::new(kernel, indices(self.mel.n_mels))
        })
    }
}

/// The spectrum behind an exponent.
pub fn quantity_of(power: f64) -> corsmal_dsp::Result<Quantity> {
    match power {
        2.0 => Ok(Quantity::Power),
        1.0 => Ok(Quantity::Magnitude),
        other => Err(corsmal_dsp::DspError::parameter("power", other, "1 or 2")),
    }
}
