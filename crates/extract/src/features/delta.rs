//! `delta`: local derivatives over frames of an earlier feature.

use corsmal_dsp::delta::{DeltaMode, DeltaParams, delta, delta_weights};
use ndarray::{ArrayView2, s};
use serde::{Deserialize, Serialize};

use super::derived::{Derived, FrameShape, InTime, TooFewFrames};
use super::kernel::Feature;
use super::kind::FeatureKind;
use crate::params::{Keys, at_most};

/// Widest window of frames.
const MAX_WIDTH: usize = 1 << 16;
/// Frames that are derived at a time, beyond those that a window covers.
const BLOCK: usize = 256;

/// Parameters of `delta`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Delta {
    of: String,
    width: usize,
    order: usize,
    mode: DeltaMode,
}

impl Default for Delta {
    fn default() -> Self {
        let DeltaParams { width, order, mode } = DeltaParams::default();
        Self { of: "mfcc".into(), width, order, mode }
    }
}

impl Derived for DeltaParams {
    fn start(&self, shape: FrameShape) -> Box<dyn InTime + '_> {
        Box::new(Slope { params: self, series: shape.len(), held: Vec::new(), first: 0, next: 0 })
    }
}

/// Frames that a window still reaches, and those that wait for frames after them.
struct Slope<'p> {
    params: &'p DeltaParams,
    series: usize,
    /// `[frames][series]`, from frame `first` on.
    held: Vec<f32>,
    first: usize,
    /// The frame whose derivative comes next.
    next: usize,
}

impl Slope<'_> {
    fn frames(&self) -> usize {
        self.held.len() / self.series.max(1)
    }

    /// Appends the derivatives of the held frames up to `end` (counted from the first held one).
    fn derive(&mut self, end: usize, out: &mut Vec<f32>) -> corsmal_dsp::Result<()> {
        let frames = self.frames();
        let held = ArrayView2::from_shape((frames, self.series), &self.held)
            .expect("frames of equal length");
        let slopes = delta(held.t(), self.params)?;
        let fresh = slopes.slice(s![.., self.next - self.first..end]);
        out.extend(fresh.t().iter());
        self.next = self.first + end;
        Ok(())
    }
}

impl InTime for Slope<'_> {
    fn push(&mut self, frames: &[f32], out: &mut Vec<f32>) {
        for frame in frames.chunks_exact(self.series) {
            self.held.extend_from_slice(frame);
            let (held, width) = (self.frames(), self.params.width);
            // The last frames stand before the first ones: all are needed.
            if self.params.mode == DeltaMode::Wrap || held < 2 * width + BLOCK {
                continue;
            }
            // A window lies within what is held; the frames at its ends are not the recording's.
            if self.derive(held - width / 2, out).is_ok() {
                let done = held - width;
                self.held.drain(..done * self.series);
                self.first += done;
            }
        }
    }

    fn finish(&mut self, out: &mut Vec<f32>) -> Result<(), TooFewFrames> {
        let frames = self.frames();
        let needed = self.params.width;
        self.derive(frames, out).map_err(|_| TooFewFrames { frames: self.first + frames, needed })
    }
}

impl FeatureKind for Delta {
    const KIND: &'static str = "delta";
    const ABOUT: &'static str = "Local derivative over frames (librosa.feature.delta) of the \
        feature named by `of`: the order-th derivative of the polynomial of that degree fitted to \
        `width` frames.";
    const KEYS: &'static [Keys] = &[&[
        (
            "of",
            "Name of an earlier feature in this configuration, of which the derivative is taken.",
        ),
        ("width", "Frames that the polynomial is fitted to: odd, at least 3."),
        ("order", "Order of the derivative, and degree of the polynomial."),
        (
            "mode",
            "Values beyond the ends: interp (the polynomial of the first or last frames), \
             nearest, mirror, constant (zeros) or wrap (holds all frames in memory).",
        ),
    ]];
    const PYTHON: &'static str = "feature.delta";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let params = DeltaParams { width: self.width, order: self.order, mode: self.mode };
        at_most("width", self.width, MAX_WIDTH)?;
        delta_weights(&params)?;
        Ok(Feature::of_earlier(&self.of, params))
    }
}
