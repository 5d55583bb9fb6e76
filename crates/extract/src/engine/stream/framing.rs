//! How a stream cuts the signal into frames, and what it is given of them.

use corsmal_dsp::lanes::Row;
use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::time_domain::FrameParams;

/// Frames of the waveform as a stream cuts them.
#[derive(Debug, Clone, Copy)]
pub struct Framing {
    /// Samples in a frame.
    pub length: usize,
    /// Samples between frames.
    pub hop: usize,
    /// Samples before the first sample of the signal in frame 0.
    pub pad: usize,
    /// What lies outside the signal.
    pub mode: PadMode,
}

impl Framing {
    /// Frames of a transform.
    pub fn of_transform(params: &StftParams) -> Self {
        let StftParams { n_fft: length, hop_length: hop, pad_mode: mode, .. } = *params;
        Self { length, hop, pad: params.pad(), mode }
    }

    /// Frames of the waveform.
    pub fn of_wave(params: &FrameParams, mode: PadMode) -> Self {
        let FrameParams { frame_length: length, hop_length: hop, .. } = *params;
        Self { length, hop, pad: params.pad(), mode }
    }

    /// Frames of `n` samples.
    pub fn n_frames(&self, n: u64) -> u64 {
        let padded = n + 2 * self.pad as u64;
        if n == 0 || padded < self.length as u64 {
            0
        } else {
            1 + (padded - self.length as u64) / self.hop as u64
        }
    }
}

/// Successive frames of the signal.
#[derive(Clone, Copy)]
pub struct Frames<'a> {
    /// Interleaved samples, from the first one of the first frame on, padding included.
    pub samples: &'a [f32],
    /// Number of frames.
    pub count: usize,
    /// Channels.
    pub channels: usize,
}

/// One pass over the frames of the signal, with the kernels of the features that share it.
pub trait Stream: Send + Sync {
    /// How frames are cut.
    fn framing(&self) -> Framing;

    /// Length of its transform, where it has one.
    fn n_fft(&self) -> Option<usize> {
        None
    }

    /// Appends the values of every feature to `raw[feature]`, as `[frames][rows][channels]`.
    fn run(&self, frames: Frames<'_>, raw: &mut [Vec<f32>], scratch: &mut Scratch);
}

/// Rows of a block and of its spectra, reused for every block of a worker.
#[derive(Default)]
pub struct Scratch {
    /// Windowed samples.
    pub frames: Vec<Row>,
    /// Power, magnitude or complex rows.
    pub spectrum: Vec<Row>,
    /// The rows of one feature.
    pub rows: Vec<Row>,
    /// Samples of frames that reach beyond the signal.
    pub edge: Vec<f32>,
}
