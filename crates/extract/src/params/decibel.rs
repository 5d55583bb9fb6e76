//! Conversions to decibels.

use corsmal_dsp::decibel::Decibel;
use serde::{Deserialize, Serialize};

use super::keys::Keys;
use super::word::{AutoOr, number_or_word};

/// The reference of a conversion to decibels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DbRef {
    /// This value becomes 0 dB.
    Value(f64),
    /// The maximum becomes 0 dB.
    Max,
}

/// Range kept below the maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TopDb {
    /// In dB.
    Range(f64),
    /// Everything.
    None,
}

/// Unit of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// As computed.
    #[default]
    Linear,
    /// `10 log10` (librosa.power_to_db).
    PowerToDb,
    /// `20 log10` (librosa.amplitude_to_db): values, reference and smallest value are squared first.
    AmplitudeToDb,
}

number_or_word!(DbRef, Value, Max, "max");
number_or_word!(TopDb, Range, None, "none");

impl Scale {
    /// What its key means.
    pub const KEYS: Keys = &[(
        "scale",
        "Unit: linear (as computed), power_to_db (10 log10) or amplitude_to_db (20 log10); ref, \
         amin and top_db apply only to decibels.",
    )];
}

/// Conversion to decibels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DbSpec {
    /// Value (or `"max"`) that becomes 0 dB.
    #[serde(rename = "ref")]
    pub reference: DbRef,
    /// Smallest value told apart from zero, in the unit of the values; `auto` is librosa's default,
    /// 1e-10 of a power and 1e-5 of an amplitude.
    pub amin: AutoOr,
    /// Range kept below the maximum, in dB, or `"none"`.
    pub top_db: TopDb,
    /// The maximum is that of each channel (false) or of all channels, as librosa 0.11 takes it on
    /// multi-channel arrays (true).
    pub joint: bool,
}

impl Default for DbSpec {
    fn default() -> Self {
        Self {
            reference: DbRef::Value(1.0),
            amin: AutoOr::Auto,
            top_db: TopDb::Range(80.0),
            joint: false,
        }
    }
}

impl DbSpec {
    /// The checked parameters, for powers: those of an amplitude are squared. A reference of `"max"`
    /// is left at 1 here and applied by [`DbSpec::level`].
    pub fn decibel(&self, scale: Scale) -> corsmal_dsp::Result<Decibel> {
        let reference = match self.reference {
            DbRef::Value(v) => v,
            DbRef::Max => 1.0,
        };
        let top_db = match self.top_db {
            TopDb::Range(v) => Some(v),
            TopDb::None => None,
        };
        let power = |value: f64| if scale == Scale::AmplitudeToDb { value * value } else { value };
        let amin = match (self.amin, scale) {
            (AutoOr::Value(amin), _) => amin,
            (AutoOr::Auto, Scale::AmplitudeToDb) => 1e-5,
            (AutoOr::Auto, _) => 1e-10,
        };
        Decibel { reference, amin, top_db }.check()?;
        if power(amin) < f64::from(f32::MIN_POSITIVE) {
            let allowed = "at least 1.2e-38 (for amplitudes, its square too), since features are \
                           single precision";
            return Err(corsmal_dsp::DspError::parameter("amin", amin, allowed));
        }
        Ok(Decibel { reference: power(reference), amin: power(amin), top_db })
    }

    /// What to set so that values do not depend on the maximum of the recording.
    pub const WITHOUT_PEAK: &'static str = "top_db to \"none\" and its ref to a number";

    /// Whether values depend on the maximum of the recording.
    pub fn needs_peak(&self) -> bool {
        self.reference == DbRef::Max || self.top_db != TopDb::None
    }

    /// What is subtracted from every value, and the floor below the maximum, given that maximum.
    pub fn level(&self, peak: f32) -> (f32, f32) {
        let shift = if self.reference == DbRef::Max { peak } else { 0.0 };
        let floor = match self.top_db {
            TopDb::Range(range) => peak - range as f32,
            TopDb::None => f32::NEG_INFINITY,
        };
        (shift, floor)
    }
}

impl DbSpec {
    /// What its keys mean.
    pub const KEYS: Keys = &[
        ("ref", "Value that becomes 0 dB; \"max\": the maximum of the recording."),
        (
            "amin",
            "Smallest value distinguished from zero, in the unit of the values; \"auto\": 1e-10 \
             for power, 1e-5 for amplitude.",
        ),
        (
            "top_db",
            "Range below the maximum in dB; lower values are raised to it; \"none\": keep all \
             values.",
        ),
        (
            "joint",
            "The maximum is that of each channel (false), or of all channels together as in librosa (true).",
        ),
    ];
}
