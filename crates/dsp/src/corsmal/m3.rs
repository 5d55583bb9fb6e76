//! M3 (Concatenation, "VA2Mass"): a spectrogram of the end of the recording.

use ndarray::{Array2, ArrayView2, Axis};

use super::{check_expansion, mono};
use crate::error::Result;
use crate::resample::{before_last, resample_last};
use crate::stft::{StftParams, spectrogram};

const SR: f64 = 16_600.0;
const SAMPLES: usize = 32_000;

/// Magnitude spectrogram of the last 32,000 samples of the mean channel at 16,600 Hz.
///
/// The paper gives neither window nor hop and there is no code. Its perceptrons take 6193 values, as
/// their number of parameters shows, which is 563 bins of 11 frames: frames of 1124 samples within
/// the ends, every 3087. That, and zeros in front of shorter recordings, are choices of ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct M3Spectrogram {
    /// Length of the transform in samples.
    pub n_fft: usize,
    /// Samples between frames.
    pub hop_length: usize,
}

impl Default for M3Spectrogram {
    fn default() -> Self {
        Self { n_fft: 1124, hop_length: 3087 }
    }
}

impl M3Spectrogram {
    /// How many of the first of `frames` frames at `sr` Hz may be left out: the same bits come of the rest.
    ///
    /// # Errors
    /// Impossible rates.
    pub fn unread(&self, sr: f64, frames: u64) -> Result<u64> {
        check_expansion(sr, SR)?;
        before_last(sr, SR, frames, SAMPLES)
    }

    /// `[n_fft / 2 + 1, frames]` (563 x 11) of `y [channels, samples]`.
    ///
    /// # Errors
    /// Impossible rates or parameters, non-finite samples.
    pub fn run(&self, y: ArrayView2<f32>, sr: f64) -> Result<Array2<f32>> {
        check_expansion(sr, SR)?;
        let mono = mono(y)?;
        let mono = mono.as_standard_layout();
        let samples = mono.as_slice().expect("contiguous");
        let mut last = resample_last(samples, sr, SR, SAMPLES)?;
        last.splice(0..0, std::iter::repeat_n(0.0, SAMPLES - last.len()));
        let last = Array2::from_shape_vec((1, SAMPLES), last).expect("one row");
        let params = StftParams { center: false, ..StftParams::new(self.n_fft, self.hop_length) };
        let spectrum = spectrogram(last.view(), &params, 1.0)?;
        Ok(spectrum.index_axis_move(Axis(0), 0))
    }
}
