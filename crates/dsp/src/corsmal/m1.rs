//! M1 ("Challengers"): a short-time Fourier transform.

use ndarray::{Array2, ArrayView2, Axis};

use crate::error::Result;
use crate::mono::to_mono;
use crate::stft::{StftParams, spectrogram};

/// Magnitudes of a short-time Fourier transform of the mean channel at its own rate.
///
/// The paper gives no parameters and there is no code: librosa's defaults are a choice of ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct M1Stft {
    /// Length of the transform in samples.
    pub n_fft: usize,
    /// Samples between frames.
    pub hop_length: usize,
}

impl Default for M1Stft {
    fn default() -> Self {
        Self { n_fft: 2048, hop_length: 512 }
    }
}

impl M1Stft {
    /// `[n_fft / 2 + 1, frames]` of `y [channels, samples]`.
    ///
    /// # Errors
    /// No samples, or impossible parameters.
    pub fn run(&self, y: ArrayView2<f32>) -> Result<Array2<f32>> {
        let mono = to_mono(y)?.insert_axis(Axis(0));
        let params = StftParams::new(self.n_fft, self.hop_length);
        Ok(spectrogram(mono.view(), &params, 1.0)?.index_axis_move(Axis(0), 0))
    }
}
