//! The compound systems of the CORSMAL benchmark: the inputs of M1 to M6, the baselines' 9216 and
//! 193 values, and pyAudioAnalysis. One plan per system; `run` takes `[channels, samples]` in -1..1
//! at any rate.
//!
//! Where a paper and its code differ the plan has a `Variant`; what neither says is a choice
//! of ours that the plan's documentation names as such.

pub mod af193;
mod image;
mod m1;
mod m2;
mod m3;
mod m4;
mod m5;
mod m6;
pub mod paa;
mod spec9216;

pub use m1::M1Stft;
pub use m2::M2Mfcc;
pub use m3::M3Spectrogram;
pub use m4::{M4LogMel, M4Plan, m4_windows};
pub use m5::{M5A34f136, M5VggishPatches, downmix_71, downmix_71_weights};
pub use m6::{M6Crop, M6Spectrogram};
pub use spec9216::Spec9216;

use ndarray::{Array1, ArrayView2, Axis, CowArray, Ix2};
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result, from_name};
use crate::mono::to_mono;
use crate::resample::{MAX_EXPANSION, ResType, resample};

/// What a system's paper says or what its published code does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// The published code, defects included.
    #[default]
    Code,
    /// The paper's words.
    Paper,
}

from_name!(Variant, "variant", "code" => Self::Code, "paper" => Self::Paper);

/// Refuses a rate that would make a recording grow beyond all bounds.
fn check_expansion(sr: f64, target_sr: f64) -> Result<()> {
    if target_sr > sr * MAX_EXPANSION {
        let allowed = format!("at least {} Hz", target_sr / MAX_EXPANSION);
        return Err(DspError::parameter("sr", sr, allowed));
    }
    Ok(())
}

/// Mean over the channels as one row; one channel as it is.
fn mono(y: ArrayView2<f32>) -> Result<CowArray<f32, Ix2>> {
    Ok(if y.nrows() == 1 { y.into() } else { to_mono(y)?.insert_axis(Axis(0)).into() })
}

/// Mean over the channels at `target_sr` (librosa `load` with `mono=True`).
fn mono_at(y: ArrayView2<f32>, sr: f64, target_sr: f64, res_type: ResType) -> Result<Array1<f32>> {
    check_expansion(sr, target_sr)?;
    let mono = mono(y)?;
    Ok(resample(mono.view(), sr, target_sr, res_type, true, false)?.remove_axis(Axis(0)))
}

#[cfg(test)]
mod tests;
