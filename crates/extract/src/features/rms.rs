//! `rms`: root-mean-square level of the waveform.

use corsmal_dsp::stft::PadMode;
use corsmal_dsp::time_domain::FrameParams;
use serde::{Deserialize, Serialize};

use super::{Feature, FeatureKind, Kernel, WaveKernel};
use crate::config::FrameSpec;

/// Parameters of `rms`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Rms {
    #[serde(flatten)]
    frame: FrameSpec,
    pad_mode: PadMode,
}

struct Level(FrameParams);

impl WaveKernel for Level {
    fn frames(&self, samples: &[f32], channels: usize, frames: usize, out: &mut Vec<f32>) {
        let FrameParams { frame_length, hop_length, .. } = self.0;
        let mut sums = vec![0.0_f64; channels];
        for t in 0..frames {
            let start = t * hop_length * channels;
            sums.fill(0.0);
            for frame in samples[start..start + frame_length * channels].chunks_exact(channels) {
                for (sum, x) in sums.iter_mut().zip(frame) {
                    *sum += f64::from(*x) * f64::from(*x);
                }
            }
            out.extend(sums.iter().map(|s| (s / frame_length as f64).sqrt() as f32));
        }
    }
}

impl FeatureKind for Rms {
    const KIND: &'static str = "rms";
    const ABOUT: &'static str = "Root of the mean square of each frame (librosa.feature.rms), full \
        scale being 1.";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let frame = self.frame.params()?;
        Ok(Feature {
            kernel: Kernel::Wave(frame, self.pad_mode, Box::new(Level(frame))),
            raw_rows: 1,
            labels: vec![String::new()],
            complex: false,
            finish: None,
        })
    }
}
