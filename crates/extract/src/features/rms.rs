//! `rms`: root-mean-square level of the waveform.

use corsmal_dsp::stft::PadMode;
use corsmal_dsp::time_domain::{FrameParams, level};
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, Kernel, WaveKernel};
use super::kind::FeatureKind;
use crate::params::{FrameSpec, Keys};

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
        let (mut sums, mut levels) = (vec![0.0; channels], vec![0.0; channels]);
        for t in 0..frames {
            let start = t * hop_length * channels;
            let frame = &samples[start..start + frame_length * channels];
            level(frame, &mut sums, &mut levels);
            out.extend_from_slice(&levels);
        }
    }
}

impl FeatureKind for Rms {
    const KIND: &'static str = "rms";
    const ABOUT: &'static str = "Root mean square of each frame (librosa.feature.rms); full scale \
                                 is 1.";
    const KEYS: &'static [Keys] = &[
        FrameSpec::KEYS,
        &[(
            "pad_mode",
            "Padding beyond the ends when centred: constant (zeros), edge, reflect or symmetric.",
        )],
    ];
    const PYTHON: &'static str = "feature.rms";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let frame = self.frame.params()?;
        let kernel = Kernel::Wave(frame, self.pad_mode, Box::new(Level(frame)));
        Ok(Feature::new(kernel, vec![String::new()]))
    }
}
