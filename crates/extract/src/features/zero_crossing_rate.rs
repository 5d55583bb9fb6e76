//! `zero_crossing_rate`: share of samples at which the signal changes sign.

use corsmal_dsp::stft::PadMode;
use corsmal_dsp::time_domain::{FrameParams, ZeroCrossingParams};
use serde::{Deserialize, Serialize};

use super::kernel::{Feature, Kernel, WaveKernel};
use super::kind::FeatureKind;
use crate::params::{FrameSpec, Keys};

/// Parameters of `zero_crossing_rate`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct ZeroCrossingRate {
    #[serde(flatten)]
    frame: FrameSpec,
    threshold: f64,
    zero_pos: bool,
    pad: bool,
}

impl Default for ZeroCrossingRate {
    fn default() -> Self {
        let ZeroCrossingParams { threshold, zero_pos, pad } = ZeroCrossingParams::default();
        Self { frame: FrameSpec::default(), threshold, zero_pos, pad }
    }
}

struct Crossings {
    frame: FrameParams,
    params: ZeroCrossingParams,
}

impl WaveKernel for Crossings {
    fn frames(&self, samples: &[f32], channels: usize, frames: usize, out: &mut Vec<f32>) {
        let FrameParams { frame_length, hop_length, .. } = self.frame;
        let spans = (0..frames).map(|t| (t * hop_length, t * hop_length + frame_length - 1));
        let counts = self.params.count(samples, channels, spans);
        let first = u32::from(self.params.pad);
        out.extend(counts.into_iter().map(|n| (n + first) as f32 / frame_length as f32));
    }
}

impl FeatureKind for ZeroCrossingRate {
    const KIND: &'static str = "zero_crossing_rate";
    const ABOUT: &'static str = "Share of the samples of a frame where the signal changes sign \
        (librosa.feature.zero_crossing_rate), between 0 and 1.";
    const KEYS: &'static [Keys] = &[
        FrameSpec::KEYS,
        &[
            ("threshold", "Samples of at most this magnitude count as zero."),
            ("zero_pos", "true: zero is positive; false: zero has its own sign."),
            ("pad", "true: the first sample of a frame counts as a crossing."),
        ],
    ];
    const PYTHON: &'static str = "feature.zero_crossing_rate";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let frame = self.frame.params()?;
        let params = ZeroCrossingParams {
            threshold: self.threshold,
            zero_pos: self.zero_pos,
            pad: self.pad,
        };
        params.check()?;
        let kernel = Kernel::Wave(frame, PadMode::Edge, Box::new(Crossings { frame, params }));
        Ok(Feature::new(kernel, vec![String::new()]))
    }
}
