//! Configurations as users write them.

use proptest::prelude::*;

use super::{Config, PRESETS, Preset};

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

fn config(text: &str, overrides: &[&str]) -> Result<Config, String> {
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    Config::with_overrides(text, "test", &overrides).map_err(|e| e.to_string())
}

#[test]
fn the_switch_is_what_it_spells_out() {
    let plain = "[features.mfcc]\n[features.rms]\n[features.af193]";
    let spelled = "[signal]\nres_type = 'kaiser_best'\n[features.mfcc]\npad_mode = 'reflect'\n\
        [features.rms]\npad_mode = 'reflect'\n[features.af193]\nlibrosa = '0.8'";
    let switched = config(plain, &["librosa=0.8"]).unwrap();
    assert_eq!(switched.to_value(), config(spelled, &[]).unwrap().to_value());
    let text = format!("librosa = '0.8'\n{plain}");
    assert_eq!(switched.hash(), config(&text, &[]).unwrap().hash());
    let modern = config(plain, &["librosa=0.11"]).unwrap();
    assert_eq!(modern.hash(), config(plain, &[]).unwrap().hash());
    assert_ne!(modern.hash(), switched.hash());
}

#[test]
fn pythons_words_are_explained() {
    let refused =
        |value: &str| config(&format!("[features.mfcc]\nfmax = {value}"), &[]).unwrap_err();
    assert!(refused("None").ends_with("; TOML has no None: leave the key out"));
    assert!(refused("True # yes").ends_with("; TOML writes true"));
    assert!(!refused("Nonesuch").contains("leave the key out"));
}

#[test]
fn what_a_configuration_says_itself_stays() {
    let text = "librosa = '0.8'\n[features.m]\nkind = 'mfcc'\npad_mode = 'edge'";
    assert_eq!(config(text, &[]).unwrap().to_value()["features"]["m"]["pad_mode"], "edge");
}

#[test]
fn what_is_spelled_out_as_the_other_versions_is_refused() {
    let preset = Preset::find("spec9216-code").unwrap();
    let refused = config(preset.toml, &["librosa=0.11"]).unwrap_err();
    let expected =
        "configuration key signal.res_type: \"kaiser_best\" is the value of librosa \"0.8\"";
    assert!(refused.starts_with(expected), "{refused}");
    let own = "librosa = '0.8'\n[features.rms]\npad_mode = 'constant'";
    let refused = config(own, &[]).unwrap_err();
    assert!(refused.contains("features.rms.pad_mode"), "{refused}");
    let own = "librosa = '0.8'\n[features.af193]\nlibrosa = '0.11'";
    assert!(config(own, &[]).unwrap_err().contains("features.af193.librosa"));
}

#[test]
fn other_versions_are_refused() {
    let refused = config("[features.mfcc]", &["librosa=0.9"]).unwrap_err();
    assert_eq!(refused, "configuration key librosa: must be \"0.8\" or \"0.11\", not 0.9");
}

#[test]
fn outermost_tables_are_checked_by_name() {
    let refused = |text: &str| config(text, &[]).unwrap_err();
    let refusal = refused("[feature.mfcc]");
    assert!(refusal.contains("feature: is unknown here: did you mean \"features\"?"), "{refusal}");
    let refusal = refused("[mfcc]\nn_mels = 3");
    assert!(refusal.contains("did you mean the table [features.mfcc]?"), "{refusal}");
    assert!(refused("[signal]").contains("features: must have at least one table"));
    assert!(refused("summary = 3\n[features.rms]").contains("must be a table with the key stats"));
}

#[test]
fn statistics_are_a_word_words_or_a_list() {
    let stats = |set: &str| {
        let found = config("[features.rms]", &[set]).unwrap();
        found.summary.unwrap().stats.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(stats("summary.stats=mean"), ["mean"]);
    assert_eq!(stats("summary.stats=mean, p95"), ["mean", "p95"]);
    assert_eq!(stats("summary.stats=[\"mean\", \"std\"]"), ["mean", "std"]);
    let refusal = config("[features.rms]", &["summary.average_channels=true"]).unwrap_err();
    assert!(refusal.contains("summary.stats: must not be empty"), "{refusal}");
}

#[test]
fn a_key_of_a_feature_that_is_not_there_changes_nothing() {
    let preset = Preset::find("logmel").unwrap().toml;
    let refusal = config(preset, &["mfcc.n_mels=64"]).unwrap_err();
    assert_eq!(
        refusal,
        "configuration key mfcc.n_mels: the configuration has no feature mfcc (it has \
         melspectrogram): did you mean melspectrogram.n_mels=64? --add mfcc adds the feature"
    );
    let added = config(preset, &["+mfcc", "mfcc.n_mels=64"]).unwrap();
    let names: Vec<&str> = added.features.iter().map(|f| f.name()).collect();
    assert_eq!(names, ["melspectrogram", "mfcc"]);
    assert_eq!(added.to_value()["features"]["mfcc"]["n_mels"], 64);
}

#[test]
fn more_work_than_sensible_time_allows_is_refused() {
    for (text, expected) in [
        ("cqt]\nhop_length = 1\nn_bins = 4000\nbins_per_octave = 600", "hop_length"),
        ("cqt]\nhop_length = 1\nsparsity = 0", "hop_length"),
        ("hpss]\nhop_length = 1\nkernel_size = 1048576", "kernel_size"),
        ("hpss]\nkernel_size = [31, 1025]", "kernel_size"),
        // The filter bank took 2 GB.
        ("melspectrogram]\nn_fft = 262144\nn_mels = 4096", "n_mels"),
        ("mfcc]\nn_fft = 262144\nn_mels = 4096", "n_mels"),
        // Not above zero in single precision: NaN in silence.
        ("spectral_flatness]\namin = 1e-300", "amin"),
    ] {
        let refused = config(&format!("[features.{text}"), &[]).unwrap_err();
        assert!(refused.contains(expected), "{text}: {refused}");
    }
    config("[features.cqt]\nhop_length = 1", &[]).unwrap();
    config("[features.hpss]\nkernel_size = 1023", &[]).unwrap();
}

#[test]
fn keys_and_words_of_librosa_are_understood_in_refusals() {
    for (change, says) in [
        ("signal.mono=true", "did you mean signal.channels?"),
        ("mfcc.sr=16000", "did you mean signal.sample_rate?"),
        ("mfcc.top_db=None", "\"none\" in small letters"),
        ("signal.channels=0", "channel 0 alone is [0]"),
        ("mfcc.n_mfcc=129", "n_mfcc must be at most n_mels (128), not 129"),
    ] {
        let refusal = Config::with_overrides("[features.mfcc]", "here", &[change.into()]);
        let refusal = refusal.unwrap_err().to_string();
        assert!(refusal.contains(says), "{change}: {refusal}");
    }
    let set = ["mfcc.n_mfcc=128".into(), "mfcc.top_db=none".into()];
    Config::with_overrides("[features.mfcc]", "here", &set).unwrap();
    let rate = ["signal.sample_rate=8000".into()];
    let refusal = Config::with_overrides("[features.af193]", "here", &rate).unwrap_err();
    assert!(refusal.to_string().contains("sr must be above 12800 Hz for af193"), "{refusal}");
}

#[test]
fn an_explained_preset_is_no_configuration() {
    let text = "A text.\n\nConfiguration hash: 0\n";
    let refusal = Config::with_overrides(text, "my.toml", &[]).unwrap_err().to_string();
    assert!(refusal.contains("presets NAME --toml"), "{refusal}");
}
