//! Versions of librosa whose numbers differ.

use serde::{Deserialize, Serialize};

use crate::error::from_name;
use crate::resample::ResType;
use crate::stft::PadMode;

/// The librosa whose conventions are followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum LibrosaVersion {
    /// 0.8: reflect padding, resampy's windowed sinc.
    #[serde(rename = "0.8")]
    V08,
    /// 0.11: zero padding, libsoxr.
    #[default]
    #[serde(rename = "0.11")]
    V011,
}

from_name!(LibrosaVersion, "librosa", "0.8" => Self::V08, "0.11" => Self::V011);

impl LibrosaVersion {
    /// The version that this one differs from.
    pub fn other(self) -> Self {
        match self {
            Self::V08 => Self::V011,
            Self::V011 => Self::V08,
        }
    }

    /// Padding of centred frames.
    pub fn pad_mode(self) -> PadMode {
        match self {
            Self::V08 => PadMode::Reflect,
            Self::V011 => PadMode::Constant,
        }
    }

    /// Converter of `load` and `resample` by default.
    pub fn res_type(self) -> ResType {
        match self {
            Self::V08 => ResType::KaiserBest,
            Self::V011 => ResType::SoxrHq,
        }
    }

    /// Converter where `kaiser_fast` was asked for, which 0.11 no longer has.
    pub fn fast_res_type(self) -> ResType {
        match self {
            Self::V08 => ResType::KaiserFast,
            Self::V011 => ResType::SoxrHq,
        }
    }
}
