//! Configurations that come with the tool; each is a file of `presets/`.

use crate::params::ConfigError;

/// A named configuration.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Name.
    pub name: &'static str,
    /// The configuration file.
    pub toml: &'static str,
}

macro_rules! presets {
    ($($name:literal),* $(,)?) => {
        &[$(Preset { name: $name, toml: include_str!(concat!("../../../../presets/", $name, ".toml")) }),*]
    };
}

/// Every preset.
pub const PRESETS: &[Preset] = presets![
    "logmel",
    "mfcc-zcr",
    "esc26",
    "esc28",
    "af193",
    "af193-paper",
    "a34f136",
    "spec9216-code",
    "m1",
    "m2",
    "m3",
    "m4-code",
    "m4-paper",
    "m5-vggish",
    "m6-code",
    "m6-paper",
    "mel-cnn",
];

impl Preset {
    /// The preset of that name.
    ///
    /// # Errors
    /// An unknown name.
    pub fn find(name: &str) -> Result<&'static Self, ConfigError> {
        PRESETS.iter().find(|p| p.name == name).ok_or_else(|| ConfigError::Preset {
            name: name.to_string(),
            choices: corsmal_names::choices(name, PRESETS.iter().map(|p| p.name)),
        })
    }
}
