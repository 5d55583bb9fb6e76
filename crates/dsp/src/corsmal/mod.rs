//! The compound systems of the CORSMAL benchmark: the inputs of M1 to M6, the baselines' 9216 and
//! 193 values, and pyAudioAnalysis. One plan per system; `run` takes `[channels, samples]` in -1..1
//! at any rate.
//!
//! Where a paper and its code differ the plan has a `Variant`; what neither says is a choice
//! of ours that the plan's documentation names as such.

pub mod af193;
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
pub use m4::{M4LogMel, m4_windows};
pub use m5::{M5A34f136, M5VggishPatches, downmix_71, downmix_71_weights};
pub use m6::{M6Crop, M6Spectrogram};
pub use spec9216::Spec9216;

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, s};
use serde::{Deserialize, Serialize};

use crate::decibel::Decibel;
use crate::error::{DspError, Result, from_name};
use crate::mono::to_mono;
use crate::real::Real;
use crate::resample::{MAX_EXPANSION, ResType, resample};
use crate::stft::{StftParams, spectrogram};

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

/// Mean over the channels at `target_sr` (librosa `load` with `mono=True`).
fn mono_at(y: ArrayView2<f32>, sr: f64, target_sr: f64, res_type: ResType) -> Result<Array1<f32>> {
    if target_sr > sr * MAX_EXPANSION {
        let allowed = format!("at least {} Hz", target_sr / MAX_EXPANSION);
        return Err(DspError::parameter("sr", sr, allowed));
    }
    let mono = to_mono(y)?.insert_axis(Axis(0));
    Ok(resample(mono.view(), sr, target_sr, res_type, true, false)?.remove_axis(Axis(0)))
}

/// `amplitude_to_db(|stft|)` `[bins, frames]` of one channel, 80 dB deep.
fn amplitude_db<T: Real>(y: ArrayView2<T>, params: &StftParams) -> Result<Array2<T>> {
    let mut power = spectrogram(y, params, 2.0)?;
    Decibel::default().power(power.as_slice_mut().expect("made in C order"))?;
    Ok(power.index_axis_move(Axis(0), 0))
}

/// [`amplitude_db`] of `y` and zeros up to `len` samples.
///
/// Frames of nothing but zeros are all alike: one is transformed, and stands for those that follow.
fn padded_amplitude_db<T: Real>(
    y: ArrayView1<T>,
    len: usize,
    params: &StftParams,
) -> Result<Array2<T>> {
    // So many zeros make the last frame such a one, whatever lies beyond them.
    let mut samples = y.to_vec();
    samples.resize(len.min(y.len() + 2 * params.n_fft), T::zero());
    let known = amplitude_db(ArrayView1::from(&samples).insert_axis(Axis(0)), params)?;
    let mut image = Array2::zeros((known.nrows(), params.n_frames(len)));
    for (mut row, known) in image.outer_iter_mut().zip(known.outer_iter()) {
        row.fill(known[known.len() - 1]);
        row.slice_mut(s![..known.len()]).assign(&known);
    }
    Ok(image)
}

#[cfg(test)]
mod tests;
