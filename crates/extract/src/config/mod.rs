//! The one configuration: signal, features, summary. It travels through everything and is stored,
//! with its hash, in every output.

mod librosa;
mod preset;
mod section;
mod set;
mod signal;
#[cfg(test)]
mod tests;

pub use crate::params::ConfigError;
pub use corsmal_dsp::resample::ResType;
pub use preset::{PRESETS, Preset};
pub use section::{SECTIONS, Section};
pub use signal::{Channels, Normalize, SignalConfig};

use std::path::Path;

use corsmal_files::content;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::features::{self, FeatureConfig};
use crate::params::typed;
use crate::projection::ProjectionConfig;
use crate::summary::SummaryConfig;

/// Version of the configuration's meaning; part of its hash.
pub const SCHEMA: u32 = 1;
/// Largest file that is read.
const MAX_BYTES: u64 = 1 << 20;

/// A checked configuration.
#[derive(Debug, Clone)]
pub struct Config {
    /// How the signal is prepared, in the order in which the steps run.
    pub signal: SignalConfig,
    /// Features in their order of output.
    pub features: Vec<FeatureConfig>,
    /// Statistics over frames; `None` writes frame-level features.
    pub summary: Option<SummaryConfig>,
    /// Fitted projection that the statistics of a recording go through.
    pub projection: Option<ProjectionConfig>,
    /// What the configuration says of itself; no number depends on it, nor the hash.
    pub description: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(default)]
    description: String,
    #[serde(default)]
    signal: Map<String, Value>,
    features: Map<String, Value>,
    summary: Option<Value>,
    projection: Option<Value>,
}

/// What to write in place of Python's word at a byte of a TOML text.
fn python_word(toml: &str, at: usize) -> Option<&'static str> {
    let rest = toml.get(at..)?;
    let is =
        |word: &str| rest.strip_prefix(word).is_some_and(|r| !r.starts_with(char::is_alphanumeric));
    [
        ("None", "TOML has no None: leave the key out"),
        ("True", "TOML writes true"),
        ("False", "TOML writes false"),
    ]
    .into_iter()
    .find_map(|(word, hint)| is(word).then_some(hint))
}

impl Config {
    /// The configuration of a preset.
    ///
    /// # Errors
    /// An unknown name.
    pub fn preset(name: &str) -> Result<Self, ConfigError> {
        Self::with_overrides(Preset::find(name)?.toml, name, &[])
    }

    /// A TOML file.
    ///
    /// # Errors
    /// Unreadable, not TOML, an unknown key or an impossible value.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, ConfigError> {
        let place = path.display().to_string();
        let text = content::read_text(path, MAX_BYTES)
            .map_err(|source| ConfigError::Read { path: place.clone(), source })?;
        Self::with_overrides(&text, &place, overrides)
    }

    /// TOML text with `key=value` overrides (`mfcc.n_mels=64`, `signal.sample_rate=16000`).
    ///
    /// # Errors
    /// As [`Config::load`].
    pub fn with_overrides(
        toml: &str,
        place: &str,
        overrides: &[String],
    ) -> Result<Self, ConfigError> {
        let syntax = |e: toml::de::Error| {
            let message = match toml.contains("\nConfiguration hash: ") {
                true => {
                    "is an explanation, not TOML: `corsmal-feat presets NAME --toml` prints the file"
                        .into()
                }
                false => {
                    let message = e.to_string().trim_end().to_string();
                    let python = e.span().and_then(|span| python_word(toml, span.start));
                    python.map_or(message.clone(), |hint| format!("{message}; {hint}"))
                }
            };
            ConfigError::Syntax { place: place.to_string(), message }
        };
        let table: toml::Table = toml::from_str(toml).map_err(syntax)?;
        Self::from_tree(set::to_json(toml::Value::Table(table)), overrides)
    }

    /// A tree of tables with `key=value` overrides.
    ///
    /// # Errors
    /// An unknown key, an impossible value, or a key that two overrides set.
    pub fn from_tree(mut tree: Value, overrides: &[String]) -> Result<Self, ConfigError> {
        set::check_once_each(overrides)?;
        for assignment in overrides {
            set::apply(&mut tree, assignment)?;
        }
        Self::from_value(tree)
    }

    /// A configuration as stored in outputs.
    ///
    /// # Errors
    /// An unknown key or an impossible value.
    pub fn from_value(mut value: Value) -> Result<Self, ConfigError> {
        if let Some(object) = value.as_object_mut() {
            match object.remove("schema") {
                None => {}
                Some(v) if v == SCHEMA => {}
                Some(v) => {
                    return Err(ConfigError::key(
                        "schema",
                        format!("must be {SCHEMA}, not {v}: it was written by another version"),
                    ));
                }
            }
            // Outputs say "frames" where no summary was asked for.
            if object.get("summary").is_some_and(Value::is_null) {
                object.remove("summary");
            }
        }
        librosa::resolve(&mut value)?;
        check_tables(&value)?;
        let raw: Raw = serde_json::from_value(value).map_err(|e| top_level(&e))?;
        let signal: SignalConfig = typed("signal", &raw.signal)?;
        signal.check()?;
        if raw.features.is_empty() {
            let message = format!("must name at least one of {}", features::kinds().join(", "));
            return Err(ConfigError::key("features", message));
        }
        let features = raw
            .features
            .into_iter()
            .map(|(name, value)| FeatureConfig::parse(&name, value))
            .collect::<Result<Vec<_>, _>>()?;
        // Values that no sample rate makes possible are refused now, not at the first file.
        let rate = signal.sample_rate;
        FeatureConfig::check(&features, (rate > 0.0).then_some(rate))?;
        let summary = match raw.summary {
            None => None,
            Some(Value::Object(table)) => {
                let summary: SummaryConfig = typed("summary", &table)?;
                summary.check()?;
                Some(summary)
            }
            Some(value) => {
                let message = format!("must be a table with the key stats, not {value}");
                return Err(ConfigError::key("summary", message));
            }
        };
        let description = raw.description;
        let mut config = Self { signal, features, summary, projection: None, description };
        if let Some(value) = raw.projection {
            config.projection =
                Some(ProjectionConfig::parse(config.summary.is_some(), &config.hash(), value)?);
        }
        Ok(config)
    }

    /// The effective configuration with every default filled in, keys in a fixed order.
    pub fn to_value(&self) -> Value {
        let features: Map<String, Value> =
            self.features.iter().map(|f| (f.name().to_string(), f.to_value())).collect();
        let mut value = serde_json::json!({
            "schema": SCHEMA,
            "signal": self.signal,
            "features": features,
            "summary": self.summary,
        });
        if let Some(projection) = &self.projection {
            value["projection"] = projection.to_value();
        }
        value
    }

    /// Refuses what would crop each window, where recordings are cut into windows.
    ///
    /// # Errors
    /// [`ConfigError`] with the key.
    pub fn check_for_windows(&self) -> Result<(), ConfigError> {
        let [start, end] = [self.signal.start, self.signal.end];
        let cropped =
            [("signal.start", start), ("signal.end", end)].into_iter().find(|(_, s)| *s != 0.0);
        cropped.map_or(Ok(()), |(key, _)| {
            let why = "must be 0 with windows, because it would crop each of them; to crop recordings first, use the columns \
                       start and end of a manifest";
            Err(ConfigError::key(key, why))
        })
    }

    /// BLAKE3 of the effective configuration, in hexadecimal, without the place of a projection.
    pub fn hash(&self) -> String {
        let value = without_place(self.to_value());
        blake3::hash(value.to_string().as_bytes()).to_hex().to_string()
    }
}

/// What counts of a configuration that a file holds; as it is where it is none.
pub(crate) fn meaning(text: &str) -> String {
    serde_json::from_str(text)
        .map_or_else(|_| text.into(), |value| without_place(value).to_string())
}

/// Of a projection the content of its file counts, not where that lies.
fn without_place(mut config: Value) -> Value {
    if let Some(projection) = config.get_mut("projection").and_then(Value::as_object_mut) {
        projection.remove("file");
    }
    config
}

/// Outermost keys.
const TABLES: [&str; 5] = ["description", "signal", "features", "summary", "projection"];

/// Refuses outermost keys that are none, and a configuration without features.
fn check_tables(tree: &Value) -> Result<(), ConfigError> {
    let Some(tables) = tree.as_object() else {
        return Err(ConfigError::key(
            "configuration",
            format!("must consist of tables, not {tree}"),
        ));
    };
    for key in tables.keys() {
        if features::find(key).is_some() {
            let message = format!("is unknown here: did you mean the table [features.{key}]?");
            return Err(ConfigError::key(key, message));
        }
        if !TABLES.contains(&key.as_str()) {
            let choices = corsmal_names::choices(key, TABLES.into_iter().chain(["librosa"]));
            return Err(ConfigError::key(key, format!("is unknown here: {choices}")));
        }
    }
    match tables.get("features") {
        Some(_) => Ok(()),
        None => {
            let message = "must have at least one table, such as [features.mfcc]";
            Err(ConfigError::key("features", message))
        }
    }
}

/// Serde's message about the outermost tables, with the key where it names one.
fn top_level(error: &serde_json::Error) -> ConfigError {
    let message = error.to_string();
    let key = message.split('`').nth(1).unwrap_or("configuration").to_string();
    ConfigError::key(key, message)
}
