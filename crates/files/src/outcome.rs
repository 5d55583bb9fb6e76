//! What became of one input.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The verdict on one input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Status {
    /// Read whole.
    Ok,
    /// Shorter than its header says; features cover the frames that are there.
    Truncated,
    /// Holds no samples.
    Empty,
    /// Cannot be decoded: the bytes contradict the format.
    Corrupt,
    /// The first bytes are of no audio format that is read.
    NotAudio,
    /// A sound file of a format or codec that is not read.
    Unsupported,
    /// Holds NaN or infinite samples.
    NonFinite,
    /// Too short for one analysis frame.
    TooShort,
    /// Its features do not fit the summary table (another channel count than the recordings before).
    Mismatch,
    /// Replaced, rewritten, grown or cut while it was read: the samples may be of two recordings.
    Changed,
    /// The operating system failed to deliver the bytes; worth another try.
    Io,
}

impl Status {
    /// Whether the output holds features of this input.
    pub fn has_features(self) -> bool {
        matches!(self, Self::Ok | Self::Truncated)
    }

    /// The name used in outputs, as `"non_finite"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Truncated => "truncated",
            Self::Empty => "empty",
            Self::Corrupt => "corrupt",
            Self::NotAudio => "not_audio",
            Self::Unsupported => "unsupported",
            Self::NonFinite => "non_finite",
            Self::TooShort => "too_short",
            Self::Mismatch => "mismatch",
            Self::Changed => "changed",
            Self::Io => "io",
        }
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// One row per input of a run, failed ones included.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outcome {
    /// The input's id, unique in the run.
    pub id: String,
    /// Where it was read from, as given (`-` is standard input).
    pub path: String,
    /// The verdict.
    pub status: Status,
    /// The verdict in words; empty for [`Status::Ok`].
    #[serde(default)]
    pub reason: String,
    /// Byte in the file at which the trouble was met, where known.
    #[serde(default)]
    pub byte_offset: Option<u64>,
    /// Frame of the file at which the stretch begins, where only a stretch is taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_frame: Option<u64>,
    /// Frames (samples per channel) that the header promises, where it does.
    #[serde(default)]
    pub declared_frames: Option<u64>,
    /// Frames (samples per channel) of the file that were decoded, up to the failure if there was one;
    /// where only a stretch is taken, those of the stretch.
    #[serde(default)]
    pub decoded_frames: u64,
    /// Sampling rate of the file in Hz, once its header was understood.
    #[serde(default)]
    pub sample_rate: Option<u32>,
    /// Channels of the file, once its header was understood.
    #[serde(default)]
    pub channels: Option<u32>,
    /// Names of the repairs that the reader made, in the order met.
    #[serde(default)]
    pub repairs: Vec<String>,
    /// [`crate::identity`] of the file; empty when it could not be read.
    #[serde(default)]
    pub identity: String,
    /// Its labels, where the output has no row with them: of an input without features.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub labels: BTreeMap<String, String>,
}

impl Outcome {
    /// A row with `status` and `reason` and nothing yet known about the file.
    pub fn new(
        id: impl Into<String>,
        path: impl Into<String>,
        status: Status,
        reason: impl Into<String>,
    ) -> Self {
        Self {
            id: id.into(),
            path: path.into(),
            status,
            reason: reason.into(),
            byte_offset: None,
            start_frame: None,
            declared_frames: None,
            decoded_frames: 0,
            sample_rate: None,
            channels: None,
            repairs: Vec::new(),
            identity: String::new(),
            labels: BTreeMap::new(),
        }
    }

    /// How long the recording is, or the stretch of it that is taken, as far as it was decoded.
    pub fn seconds(&self) -> Option<f64> {
        let rate = self.sample_rate.filter(|rate| *rate > 0)?;
        Some(self.decoded_frames as f64 / f64::from(rate))
    }

    /// Where the stretch lies in its recording, from and to in seconds; `None` where all of it is taken.
    pub fn stretch(&self) -> Option<(f64, f64)> {
        let rate = self.sample_rate.filter(|rate| *rate > 0)?;
        let start = self.start_frame? as f64 / f64::from(rate);
        Some((start, start + self.seconds()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Status; 11] = [
        Status::Ok,
        Status::Truncated,
        Status::Empty,
        Status::Corrupt,
        Status::NotAudio,
        Status::Unsupported,
        Status::NonFinite,
        Status::TooShort,
        Status::Mismatch,
        Status::Changed,
        Status::Io,
    ];

    #[test]
    fn names_are_the_serialised_names() {
        for status in ALL {
            let json = serde_json::to_string(&status).unwrap();
            assert_eq!(json, format!("\"{status}\""));
        }
    }

    #[test]
    fn a_row_survives_json() {
        let mut row = Outcome::new("a/ü", "x/ü.wav", Status::Truncated, "data chunk ends early");
        row.byte_offset = Some(44);
        row.declared_frames = Some(10);
        row.decoded_frames = 7;
        row.repairs = vec!["data_size".into()];
        let json = serde_json::to_string(&row).unwrap();
        assert_eq!(serde_json::from_str::<Outcome>(&json).unwrap(), row);
    }
}
