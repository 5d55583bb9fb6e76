//! Formats of recordings: those that a model was trained on, and those that it takes.

use std::collections::BTreeSet;

use corsmal_files::outcome::Outcome;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use crate::lengths::Lengths;
use crate::words;

/// Formats of the recordings that a model was trained on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedOn {
    /// sampling rates in Hz, ascending
    pub sample_rates: Vec<u32>,
    /// channel counts, ascending
    pub channels: Vec<u32>,
    /// how long they are; absent where unknown, as in models of version 0.1.0
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<Lengths>,
}

impl TrainedOn {
    /// The formats of some recordings, given as (rate, channels); `None` unless all are known.
    pub fn of(formats: impl IntoIterator<Item = (Option<u32>, Option<u32>)>) -> Option<Self> {
        let (mut rates, mut channels) = (BTreeSet::new(), BTreeSet::new());
        for (rate, count) in formats {
            rates.insert(rate?);
            channels.insert(count?);
        }
        let known = !rates.is_empty();
        let (sample_rates, channels) =
            (rates.into_iter().collect(), channels.into_iter().collect());
        known.then_some(Self { sample_rates, channels, seconds: None })
    }

    /// Formats and lengths of extracted recordings; `None` unless all formats are known.
    pub fn of_outcomes(outcomes: &[Outcome]) -> Option<Self> {
        let good = || outcomes.iter().filter(|o| o.status.has_features());
        let formats = Self::of(good().map(|o| (o.sample_rate, o.channels)))?;
        Some(Self { seconds: Lengths::of(good().filter_map(Outcome::seconds)), ..formats })
    }

    /// Says that the recordings have several sample rates and, by their configuration, keep them.
    pub fn mixed_rates(&self, config: &Value) -> Option<String> {
        let own_rate = config["signal"]["sample_rate"].as_f64() == Some(0.0);
        (own_rate && self.sample_rates.len() > 1).then(|| {
            let rates: Vec<String> = self.sample_rates.iter().map(u32::to_string).collect();
            let rates = rates.join(", ");
            format!("the recordings have sample rates of {rates} Hz, so their features differ")
        })
    }

    /// Which recordings may have features by the configuration `used`, where those trained on were
    /// made by `own`.
    ///
    /// # Errors
    /// [`OtherRate`] for a rate to which no training recording was brought.
    pub fn rule(&self, own: &Value, used: &Value) -> std::result::Result<FormatRule, OtherRate> {
        let own_rate = rate(used) == 0.0;
        let rates = &self.sample_rates;
        // The rates of files say nothing where all were resampled.
        let trained = match rate(own) {
            0.0 => rates.iter().map(|rate| f64::from(*rate)).collect(),
            resampled => vec![resampled],
        };
        let is_known = match own_rate {
            true => rate(own) == 0.0,
            false => trained.contains(&rate(used)),
        };
        if !is_known {
            let trained = trained.into_iter().map(hertz).collect::<Vec<_>>().join(", ");
            return Err(OtherRate { rate: rate(used), trained });
        }
        Ok(FormatRule {
            sample_rates: own_rate.then(|| rates.clone()),
            ..self.channel_rule(own, used)
        })
    }

    /// The same for any sample rate, and for numbers of channels that change which channels are read, but
    /// not how many features there are.
    pub fn rule_of_any_rate(&self, own: &Value, used: &Value) -> FormatRule {
        let rule = self.channel_rule(own, used);
        FormatRule { channels: rule.channels.filter(|_| !rule.selected), ..rule }
    }

    /// What numbers of channels are taken, at any sample rate.
    fn channel_rule(&self, own: &Value, used: &Value) -> FormatRule {
        let averaged = used["summary"]["average_channels"] == Value::Bool(true);
        let every_channel = used["signal"]["channels"] == "all" && !averaged;
        // One channel of eight is another signal than the one channel of a mono recording. Whoever
        // sets other channels than the model's has decided.
        let channels = &used["signal"]["channels"];
        let selected = channels.is_array() && *channels == own["signal"]["channels"];
        FormatRule {
            sample_rates: None,
            channels: (every_channel || selected).then(|| self.channels.clone()),
            selected,
            fixed: false,
        }
    }
}

/// The rate that a configuration resamples to; 0 where recordings keep their own.
fn rate(config: &Value) -> f64 {
    config["signal"]["sample_rate"].as_f64().unwrap_or(0.0)
}

/// Whether `used` resamples, and to the same rate as `own`.
pub(crate) fn is_resampled_alike(own: &Value, used: &Value) -> bool {
    rate(used) != 0.0 && rate(used) == rate(own)
}

/// Recordings would be brought to a rate that the model was not trained on.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("signal.sample_rate must be {trained}, as in training, not {rate}")]
pub struct OtherRate {
    /// the rate asked for in Hz
    pub rate: f64,
    /// the rates in the model
    pub trained: String,
}

/// Which recordings a model may be applied to, as far as their format matters to its features.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FormatRule {
    /// rates that are taken; every one where it is `None`
    sample_rates: Option<Vec<u32>>,
    /// numbers of channels that are taken
    channels: Option<Vec<u32>>,
    /// whether the features are of some of the channels only
    selected: bool,
    /// whether the model takes no other features
    fixed: bool,
}

impl FormatRule {
    /// The same for a network: no other configuration of its features gives what it takes.
    pub fn of_fixed_features(self) -> Self {
        Self { fixed: true, ..self }
    }

    /// The sample rates in Hz that are taken; `None` for any.
    pub fn sample_rates(&self) -> Option<&[u32]> {
        self.sample_rates.as_deref()
    }

    /// The channel counts that are taken; `None` for any.
    pub fn channels(&self) -> Option<&[u32]> {
        self.channels.as_deref()
    }

    /// Refuses a recording of another format in words that say what to do; what is unknown passes.
    ///
    /// # Errors
    /// The refusal.
    pub fn check(
        &self,
        sample_rate: Option<u32>,
        channels: Option<u32>,
    ) -> std::result::Result<(), String> {
        let mut differences = Vec::new();
        if let (Some(known), Some(rate)) = (&self.sample_rates, sample_rate)
            && !known.contains(&rate)
        {
            let trained = known.iter().map(|rate| hertz((*rate).into()));
            let trained = trained.collect::<Vec<_>>().join(", ");
            let resample = known[0];
            differences.push(format!(
                "{}; the model was trained on {trained}: --set signal.sample_rate={resample} \
                 resamples it, --any-rate takes it as it is",
                hertz(rate.into())
            ));
        }
        if let (Some(known), Some(count)) = (&self.channels, channels)
            && !known.contains(&count)
        {
            let trained: Vec<String> = known.iter().map(u32::to_string).collect();
            let remedy = match (known.as_slice(), self.selected) {
                (_, true) => {
                    "--set signal.channels=mean mixes them, --any-rate takes the channels that the \
                     model reads"
                }
                ([1], false) => "--set signal.channels=mean mixes them",
                _ if self.fixed => "give recordings of as many channels",
                _ => {
                    "a model for any number needs training features with signal.channels=mean or \
                     summary.average_channels=true"
                }
            };
            let ending = if known == &[1] { "" } else { "s" };
            differences.push(format!(
                "{}; the model was trained on recordings of {} channel{ending}: {remedy}",
                words::count(count as usize, "channel"),
                trained.join(", ")
            ));
        }
        if differences.is_empty() { Ok(()) } else { Err(differences.join("; and ")) }
    }
}

/// `44,100 Hz`
fn hertz(rate: f64) -> String {
    if rate < 1000.0 || rate.fract() != 0.0 {
        return format!("{rate} Hz");
    }
    format!("{},{:03} Hz", (rate / 1000.0).trunc(), rate % 1000.0)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A model of recordings resampled to 4000.5 Hz refused them.
    #[test]
    fn a_fractional_rate_is_that_of_training() {
        let trained = TrainedOn::of([(Some(8000), Some(1))]).unwrap();
        let config = |rate: f64| json!({"signal": {"sample_rate": rate, "channels": "all"}});
        let own = config(4000.5);
        assert_eq!(trained.rule(&own, &own).unwrap().sample_rates(), None);
        for other in [4000.0, 4000.25, 8000.0, 0.0] {
            let refused = trained.rule(&own, &config(other)).unwrap_err().to_string();
            assert!(refused.contains("must be 4000.5 Hz"), "{refused}");
        }
        let refused = trained.rule(&config(0.0), &config(16_000.0)).unwrap_err();
        assert_eq!((refused.rate, refused.trained.as_str()), (16_000.0, "8,000 Hz"));
        // Any rate says nothing about channels.
        let any = trained.rule_of_any_rate(&own, &config(4000.0));
        assert!(any.check(Some(16_000), Some(1)).is_ok() && any.check(None, Some(2)).is_err());
        let spelled = [(44_100.0, "44,100 Hz"), (8000.0, "8,000 Hz"), (0.5, "0.5 Hz")];
        assert!(spelled.into_iter().all(|(rate, text)| hertz(rate) == text));
    }
}
