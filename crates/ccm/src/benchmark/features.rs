//! The three feature sets of the audio baselines, as configurations of `extract`.

use corsmal_extract::config::{Config, ConfigError, Preset};

/// What changes the presets' numbers, those of librosa 0.11, into the published ones: kaiser_best
/// resampling and reflected edges, above all.
const PUBLISHED: &str = "librosa=0.8";

/// A feature set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FeatureSet {
    /// Means and deviations of MFCC 1 to 12 and of the zero-crossing rate: 26 values.
    ZcrMfcc,
    /// Means of MFCC, chroma, mel, spectral contrast and tonnetz: 193 values.
    Af193,
    /// Spectrogram resized to 96 x 96: 9,216 values.
    Spectrogram,
}

impl FeatureSet {
    /// All sets.
    pub const ALL: [Self; 3] = [Self::ZcrMfcc, Self::Af193, Self::Spectrogram];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::ZcrMfcc => "ZCR + MFCCs",
            Self::Af193 => "AF193",
            Self::Spectrogram => "Spect.",
        }
    }

    /// Name in files.
    pub fn slug(self) -> &'static str {
        match self {
            Self::ZcrMfcc => "zcr-mfcc",
            Self::Af193 => "af193",
            Self::Spectrogram => "spectrogram",
        }
    }

    /// The preset it comes from.
    pub fn preset(self) -> &'static str {
        match self {
            Self::ZcrMfcc => "esc26",
            Self::Af193 => "af193",
            Self::Spectrogram => "spec9216-code",
        }
    }

    /// The configuration that gives the numbers of the published code.
    ///
    /// # Errors
    /// None in practice; the presets are part of the tool.
    pub fn config(self) -> Result<Config, ConfigError> {
        let preset = Preset::find(self.preset())?;
        Config::with_overrides(preset.toml, preset.name, &[PUBLISHED.into()])
    }

    /// Whether training recordings are cropped to their annotated action.
    pub fn cropped(self) -> bool {
        self == Self::Spectrogram
    }
}
