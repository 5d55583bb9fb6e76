//! `zero_crossing_rate`: share of samples at which the signal changes sign.

use corsmal_dsp::stft::PadMode;
use corsmal_dsp::time_domain::{FrameParams, ZeroCrossingParams};
use serde::{Deserialize, Serialize};

use super::{Feature, FeatureKind, Kernel, WaveKernel};
use crate::config::FrameSpec;

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
    const ABOUT: &'static str = "Share of the samples of a frame at which the signal changes sign \
        (librosa.feature.zero_crossing_rate), between 0 and 1.";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let frame = self.frame.params()?;
        let params = ZeroCrossingParams {
            threshold: self.threshold,
            zero_pos: self.zero_pos,
            pad: self.pad,
        };
        params.check()?;
        Ok(Feature {
            kernel: Kernel::Wave(frame, PadMode::Edge, Box::new(Crossings { frame, params })),
            raw_rows: 1,
            labels: vec![String::new()],
            complex: false,
            finish: None,
        })
    }
}
