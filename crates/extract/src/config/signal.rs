//! How a recording becomes the signal that features are computed from.

use corsmal_dsp::resample::ResType;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use crate::params::ConfigError;

/// Which channels, or how they are combined.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Channels {
    /// Every channel by itself.
    #[default]
    All,
    /// The mean of all channels (librosa's mono).
    Mean,
    /// ffmpeg's `-ac 1` of eight channels taken as 7.1, which the A34F features used.
    Downmix71,
    /// These channels, counted from 0, in this order.
    List(Vec<usize>),
}

const CHANNELS: &str = "\"all\", \"mean\", \"downmix-7.1\" or a list of indices such as [0, 2]";

impl Serialize for Channels {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All => s.serialize_str("all"),
            Self::Mean => s.serialize_str("mean"),
            Self::Downmix71 => s.serialize_str("downmix-7.1"),
            Self::List(list) => list.serialize(s),
        }
    }
}

impl<'de> Deserialize<'de> for Channels {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(d)?;
        match value.as_str() {
            Some("all") => return Ok(Self::All),
            Some("mean") => return Ok(Self::Mean),
            Some("downmix-7.1") => return Ok(Self::Downmix71),
            _ => {}
        }
        if let Some(index) = value.as_u64() {
            let message = format!("expected {CHANNELS}; channel {index} alone is [{index}]");
            return Err(serde::de::Error::custom(message));
        }
        match serde_json::from_value::<Vec<usize>>(value) {
            Ok(list) if !list.is_empty() => Ok(Self::List(list)),
            _ => Err(serde::de::Error::custom(format!("expected {CHANNELS}"))),
        }
    }
}

/// How a recording is brought to a common level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Normalize {
    /// Left as it is.
    #[default]
    None,
    /// Divided by its largest magnitude (over all channels); silence stays silence.
    Peak,
    /// Divided by its root-mean-square value (over all channels); silence stays silence.
    Rms,
}

/// How the signal is prepared, in the order in which the steps run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SignalConfig {
    /// Channels to take.
    pub channels: Channels,
    /// First second taken (a manifest's start is added to it).
    pub start: f64,
    /// Last second taken; 0 is the end of the recording.
    pub end: f64,
    /// Rate in Hz to resample to; 0 keeps that of the recording.
    pub sample_rate: f64,
    /// Filter of the resampling: `soxr_hq` is librosa's default since 0.10, `kaiser_best` was it
    /// before.
    pub res_type: ResType,
    /// `y[n] = x[n] - preemphasis * x[n - 1]`, the first sample unchanged; 0 for none.
    pub preemphasis: f64,
    /// Common level. Needs the whole recording in memory.
    pub normalize: Normalize,
    /// Seconds to cut or zero-pad to (at the end); 0 keeps the length.
    pub length: f64,
}

impl Default for SignalConfig {
    fn default() -> Self {
        Self {
            channels: Channels::All,
            start: 0.0,
            end: 0.0,
            sample_rate: 0.0,
            res_type: ResType::SoxrHq,
            preemphasis: 0.0,
            normalize: Normalize::None,
            length: 0.0,
        }
    }
}

impl SignalConfig {
    /// Refuses impossible values.
    pub fn check(&self) -> Result<(), ConfigError> {
        let range = |key: &str, value: f64, low: f64, high: f64, allowed: &str| {
            if value.is_finite() && (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(ConfigError::key(
                    format!("signal.{key}"),
                    format!("must be {allowed}, not {value:?}"),
                ))
            }
        };
        let place = "0 to 1000000000 seconds";
        range("start", self.start, 0.0, 1e9, place)?;
        range("end", self.end, 0.0, 1e9, place)?;
        range("length", self.length, 0.0, 1e6, "0 to 1000000 seconds")?;
        range("preemphasis", self.preemphasis, -1.0, 1.0, "-1 to 1 (0 for none)")?;
        if self.sample_rate != 0.0 {
            range(
                "sample_rate",
                self.sample_rate,
                1.0,
                768_000.0,
                "0 (keep the rate of the recording) or 1 to 768000 Hz",
            )?;
        }
        if self.end != 0.0 && self.end <= self.start {
            let message = format!(
                "must be 0 (to the end) or above signal.start ({}), not {}",
                self.start, self.end
            );
            return Err(ConfigError::key("signal.end", message));
        }
        Ok(())
    }
}
