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
        // Crossings between successive marks; a mark is where some frame starts or ends.
        let mut marks: Vec<usize> =
            (0..frames).flat_map(|t| [t * hop_length, t * hop_length + frame_length - 1]).collect();
        marks.sort_unstable();
        marks.dedup();
        let mut until = vec![0u32; marks.len() * channels];
        for m in 1..marks.len() {
            let (before, after) = until.split_at_mut(m * channels);
            let span = &samples[marks[m - 1] * channels..(marks[m] + 1) * channels];
            let total = &mut after[..channels];
            total.copy_from_slice(&before[(m - 1) * channels..]);
            corsmal_dsp::simd::vectorized(
                #[inline(always)]
                || count(&self.params, span, channels, total),
            );
        }
        let at = |sample: usize| marks.binary_search(&sample).unwrap_or(0) * channels;
        let first = u32::from(self.params.pad);
        for t in 0..frames {
            let start = at(t * hop_length);
            let end = at(t * hop_length + frame_length - 1);
            out.extend(
                (0..channels).map(|c| {
                    (until[end + c] - until[start + c] + first) as f32 / frame_length as f32
                }),
            );
        }
    }
}

/// Adds the crossings of each channel between the first and the last frame of `span`.
#[inline(always)]
fn count(params: &ZeroCrossingParams, span: &[f32], channels: usize, total: &mut [u32]) {
    const LANES: usize = 16;
    let (high, low) = (params.threshold as f32, -(params.threshold as f32));
    let zero_is_a_sign = !params.zero_pos;
    let crossed = |a: f32, b: f32| {
        let negative = (a < low) != (b < low);
        u32::from(negative | (zero_is_a_sign & ((a > high) != (b > high))))
    };
    let pairs = span.len().saturating_sub(channels);
    let (before, after) = (&span[..pairs], &span[span.len() - pairs..]);
    let whole = if LANES.is_multiple_of(channels) { pairs / LANES * LANES } else { 0 };
    let mut lanes = [0u32; LANES];
    let blocks = before[..whole].as_chunks::<LANES>().0.iter();
    for (a, b) in blocks.zip(after[..whole].as_chunks::<LANES>().0) {
        for i in 0..LANES {
            lanes[i] += crossed(a[i], b[i]);
        }
    }
    if whole > 0 {
        lanes.iter().enumerate().for_each(|(i, n)| total[i % channels] += n);
    }
    for (i, (a, b)) in before[whole..].iter().zip(&after[whole..]).enumerate() {
        total[i % channels] += crossed(*a, *b);
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
