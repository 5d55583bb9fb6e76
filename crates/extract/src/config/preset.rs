//! Configurations that come with the tool; each is a file of `presets/`.

use super::ConfigError;

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
];

impl Preset {
    /// The preset of that name.
    ///
    /// # Errors
    /// An unknown name.
    pub fn find(name: &str) -> Result<&'static Self, ConfigError> {
        PRESETS.iter().find(|p| p.name == name).ok_or_else(|| ConfigError::Preset {
            name: name.to_string(),
            known: PRESETS.iter().map(|p| p.name).collect::<Vec<_>>().join(", "),
        })
    }

    /// What the preset says of itself.
    pub fn description(&self) -> String {
        let table = toml::from_str::<toml::Table>(self.toml).unwrap_or_default();
        table.get("description").and_then(|d| d.as_str()).unwrap_or_default().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    #[test]
    fn every_preset_is_valid_and_described() {
        for preset in PRESETS {
            let config = Config::preset(preset.name).unwrap();
            assert!(!preset.description().is_empty());
            // What is stored in outputs is a configuration again, with the same hash.
            let again = Config::from_value(config.to_value()).unwrap();
            assert_eq!(again.hash(), config.hash());
        }
    }
}
