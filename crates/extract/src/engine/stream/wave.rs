//! Frames of the waveform, for one feature.

use corsmal_dsp::stft::PadMode;
use corsmal_dsp::time_domain::FrameParams;

use super::framing::{Frames, Framing, Scratch, Stream};
use crate::features::WaveKernel;

/// Frames of the waveform.
pub struct WaveStream {
    framing: Framing,
    feature: usize,
    kernel: Box<dyn WaveKernel>,
}

impl WaveStream {
    /// Frames for the feature of that index.
    pub fn new(
        frame: &FrameParams,
        mode: PadMode,
        feature: usize,
        kernel: Box<dyn WaveKernel>,
    ) -> Self {
        Self { framing: Framing::of_wave(frame, mode), feature, kernel }
    }
}

impl Stream for WaveStream {
    fn framing(&self) -> Framing {
        self.framing
    }

    fn run(&self, frames: Frames<'_>, raw: &mut [Vec<f32>], _: &mut Scratch) {
        let Frames { samples, count, channels } = frames;
        self.kernel.frames(samples, channels, count, &mut raw[self.feature]);
    }
}
