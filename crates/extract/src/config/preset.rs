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
            choices: corsmal_names::choices(name, PRESETS.iter().map(|p| p.name)),
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::config::Config;

    const KEYS: &[&str] = &[
        "signal.start",
        "signal.sample_rate",
        "signal.length",
        "signal.channels",
        "mfcc.n_fft",
        "mfcc.hop_length",
        "mfcc.lifter",
        "mfcc.top_db",
        "mfcc.ref",
        "mfcc.amin",
        "mfcc.fmin",
        "mfcc.fmax",
        "melspectrogram.top_db",
        "zero_crossing_rate.threshold",
        "summary.stats",
    ];
    const VALUES: &[&str] = &[
        "0",
        "1",
        "-1",
        "nan",
        "inf",
        "-inf",
        "1e999",
        "9223372036854775807",
        "true",
        "\"mean\"",
        "[]",
        "[0, 1]",
        "{ a = 1 }",
        "[[[[[[[[1]]]]]]]]",
        "1979-05-27",
        "\"\"",
    ];

    #[test]
    fn every_preset_is_valid_and_described() {
        for preset in PRESETS {
            let config = Config::preset(preset.name).unwrap();
            assert!(!config.description.is_empty());
            // What is stored in outputs is a configuration again, with the same hash.
            let again = Config::from_value(config.to_value()).unwrap();
            assert_eq!(again.hash(), config.hash());
        }
    }

    proptest! {
        #[test]
        fn any_edit_of_a_preset_gives_an_answer(
            preset in prop::sample::select(PRESETS),
            edits in prop::collection::vec((any::<prop::sample::Index>(), "[ -~]{0,3}"), 1..4),
            key in "(signal|mfcc|summary|melspectrogram)\\.[a-z_]{0,12}",
            value in prop::sample::select(VALUES),
            known in prop::sample::select(KEYS),
        ) {
            let mut text = preset.toml.to_string();
            for (at, edit) in edits {
                let at = at.index(text.len());
                if text.is_char_boundary(at) && text.is_char_boundary(at + 1) {
                    text.replace_range(at..=at, &edit);
                }
            }
            let sets = [vec![], vec![format!("{key}={value}")], vec![format!("{known}={value}")]];
            for overrides in &sets {
                if let Ok(config) = Config::with_overrides(&text, "edited", overrides) {
                    prop_assert_eq!(Config::from_value(config.to_value()).unwrap().hash(), config.hash());
                }
            }
        }
    }
}
