//! A feature as a configuration has it.

use std::sync::Arc;

use serde_json::{Map, Value};

use super::kernel::Feature;
use super::registry::{self, Entry, Planner};
use crate::params::{ConfigError, USUAL_RATE};

/// A feature of a configuration: name, kind, checked parameters.
#[derive(Clone)]
pub struct FeatureConfig {
    name: String,
    entry: &'static Entry,
    parameters: Value,
    coefficients: Option<[usize; 2]>,
    planner: Arc<Planner>,
}

impl std::fmt::Debug for FeatureConfig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} = {}", self.name, self.to_value())
    }
}

impl FeatureConfig {
    /// Parses the table `features.NAME`. `kind` is the name unless given; `coefficients = [a, b]`
    /// keeps coefficients `a` to `b - 1`; everything else are the kind's parameters.
    ///
    /// # Errors
    /// An impossible name, an unknown kind or key, an impossible value.
    pub fn parse(name: &str, value: Value) -> Result<Self, ConfigError> {
        let prefix = format!("features.{name}");
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
            let message = "a name consists of letters, digits, _ and - only";
            return Err(ConfigError::key(prefix, message));
        }
        let Value::Object(mut table) = value else {
            return Err(ConfigError::key(prefix, format!("must be a table, not {value}")));
        };
        let kind = match table.remove("kind") {
            None => name.to_string(),
            Some(Value::String(kind)) => kind,
            Some(other) => {
                let message =
                    format!("must be one of {}, not {other}", registry::kinds().join(", "));
                return Err(ConfigError::key(format!("{prefix}.kind"), message));
            }
        };
        let Some(entry) = registry::find(&kind) else {
            let message = format!(
                "\"{kind}\" is unknown: {}",
                corsmal_names::choices(&kind, registry::kinds())
            );
            return Err(ConfigError::key(format!("{prefix}.kind"), message));
        };
        let coefficients = match table.remove("coefficients") {
            None => None,
            Some(value) => match serde_json::from_value::<[usize; 2]>(value.clone()) {
                Ok([a, b]) if a < b => Some([a, b]),
                _ => {
                    let message = format!("must be [first, end] with first < end, not {value}");
                    return Err(ConfigError::key(format!("{prefix}.coefficients"), message));
                }
            },
        };
        let (parameters, planner) = entry.parse(&prefix, &table)?;
        let planner = Arc::new(planner);
        Ok(Self { name: name.to_string(), entry, parameters, coefficients, planner })
    }

    /// Refuses what is impossible at the sample rate `sr`, where that is configured; a feature whose
    /// source is missing, comes later or cannot be read; coefficients beyond the last.
    ///
    /// # Errors
    /// The key and what is allowed.
    pub fn check(all: &[Self], sr: Option<f64>) -> Result<(), ConfigError> {
        // Coefficients kept of each feature and whether they are complex; none where the rate
        // decides.
        let mut known: Vec<Option<(Vec<String>, bool)>> = Vec::new();
        for (i, feature) in all.iter().enumerate() {
            let key = |last: &str| format!("features.{}{last}", feature.name);
            let planned = match (feature.plan(sr.unwrap_or(USUAL_RATE)), sr) {
                (Ok(planned), _) => planned,
                (Err(e), Some(_)) => return Err(ConfigError::key(key(""), e)),
                // Possible at another rate: the recordings will tell.
                (Err(_), None) => {
                    known.push(None);
                    continue;
                }
            };
            let mut source = Vec::new();
            if let Some(of) = planned.source() {
                let at = all[..i].iter().position(|f| f.name == *of).ok_or_else(|| {
                    let earlier = all[..i].iter().map(|f| f.name.as_str());
                    let choices = corsmal_names::choices(of, earlier);
                    let message =
                        format!("\"{of}\" is not the name of an earlier feature: {choices}");
                    ConfigError::key(key(".of"), message)
                })?;
                match &known[at] {
                    Some((_, true)) => {
                        let message =
                            format!("must name a feature of real values; \"{of}\" is complex");
                        return Err(ConfigError::key(key(".of"), message));
                    }
                    Some((labels, false)) => source.clone_from(labels),
                    None => {
                        known.push(None);
                        continue;
                    }
                }
            }
            let mut labels = planned.output_labels(&source);
            if let Some([first, end]) = feature.coefficients {
                if end > labels.len() {
                    let message = format!("must end at {} or before, not at {end}", labels.len());
                    return Err(ConfigError::key(key(".coefficients"), message));
                }
                labels = labels[first..end].to_vec();
            }
            known.push(Some((labels, planned.complex)));
        }
        Ok(())
    }

    /// Name of the feature in outputs.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What each number of the output is.
    pub fn about(&self) -> &'static str {
        self.entry.about()
    }

    /// Coefficients kept, `[first, end)`; `None` for all.
    pub fn coefficients(&self) -> Option<[usize; 2]> {
        self.coefficients
    }

    /// Kind and every parameter.
    pub fn to_value(&self) -> Value {
        let mut table = Map::new();
        table.insert("kind".into(), self.entry.kind().into());
        if let Some(range) = self.coefficients {
            table.insert("coefficients".into(), Value::from(range.to_vec()));
        }
        if let Value::Object(parameters) = &self.parameters {
            table.extend(parameters.clone());
        }
        Value::Object(table)
    }

    /// Plans the feature for signals of `sr` Hz.
    ///
    /// # Errors
    /// Parameters that are impossible at this rate.
    pub fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        (self.planner)(sr)
    }
}
