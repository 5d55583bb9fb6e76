//! How frames are cut, for transforms and for the waveform.

use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::time_domain::FrameParams;
use corsmal_dsp::window::Window;
use serde::{Deserialize, Serialize};

use super::keys::Keys;
use super::limits::{MAX_FRAME, MAX_N_FFT, at_most};

/// Short-time transform. Features with equal groups share one transform.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StftSpec {
    /// Length of the transform in samples.
    pub n_fft: usize,
    /// Samples between frames.
    pub hop_length: usize,
    /// Length of the window; 0 is `n_fft`.
    pub win_length: usize,
    /// Window function.
    pub window: Window,
    /// Frames are centred on multiples of the hop.
    pub center: bool,
    /// Padding at the ends.
    pub pad_mode: PadMode,
}

impl Default for StftSpec {
    fn default() -> Self {
        Self {
            n_fft: 2048,
            hop_length: 512,
            win_length: 0,
            window: Window::Hann,
            center: true,
            pad_mode: PadMode::Constant,
        }
    }
}

impl StftSpec {
    /// The checked parameters.
    pub fn params(&self) -> corsmal_dsp::Result<StftParams> {
        let params = StftParams {
            n_fft: self.n_fft,
            hop_length: self.hop_length,
            win_length: if self.win_length == 0 { self.n_fft } else { self.win_length },
            window: self.window.clone(),
            center: self.center,
            pad_mode: self.pad_mode,
        };
        params.check()?;
        at_most("n_fft", self.n_fft, MAX_N_FFT)?;
        Ok(params)
    }
}

impl StftSpec {
    /// What its keys mean.
    pub const KEYS: Keys = &[
        ("n_fft", "Samples per transform."),
        ("hop_length", "Samples from one frame to the next."),
        ("win_length", "Length of the window in samples, centred in the frame; 0: n_fft."),
        ("window", "Window function, with scipy's name: hann, hamming, blackman, ones, ..."),
        (
            "center",
            "true: frame t is centred on sample t * hop_length, with padding at the ends; false: \
             it begins there.",
        ),
        (
            "pad_mode",
            "Padding beyond the ends when centred: constant (zeros), edge, reflect or symmetric.",
        ),
    ];
}

/// Frames of the waveform.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameSpec {
    /// Samples in a frame.
    pub frame_length: usize,
    /// Samples between frames.
    pub hop_length: usize,
    /// Frames are centred on multiples of the hop.
    pub center: bool,
}

impl Default for FrameSpec {
    fn default() -> Self {
        Self { frame_length: 2048, hop_length: 512, center: true }
    }
}

impl FrameSpec {
    /// The checked parameters.
    pub fn params(&self) -> corsmal_dsp::Result<FrameParams> {
        let params = FrameParams {
            frame_length: self.frame_length,
            hop_length: self.hop_length,
            center: self.center,
        };
        params.check()?;
        at_most("frame_length", self.frame_length, MAX_FRAME)?;
        Ok(params)
    }
}

impl FrameSpec {
    /// What its keys mean.
    pub const KEYS: Keys = &[
        ("frame_length", "Samples of a frame."),
        ("hop_length", "Samples from one frame to the next."),
        (
            "center",
            "true: frame t is centred on sample t * hop_length, with padding at the ends; false: \
             it begins there.",
        ),
    ];
}
