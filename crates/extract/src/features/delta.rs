//! `delta`: local derivatives over frames of an earlier feature.

use corsmal_dsp::delta::{DeltaMode, DeltaParams, delta_weights};
use serde::{Deserialize, Serialize};

use super::{Feature, FeatureKind, Kernel};
use crate::config::at_most;

/// Widest window of frames.
const MAX_WIDTH: usize = 1 << 16;

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

impl FeatureKind for Delta {
    const KIND: &'static str = "delta";
    const ABOUT: &'static str = "Local derivative over frames (librosa.feature.delta) of the \
        feature named by `of`: the order-th derivative of the polynomial of that degree fitted to \
        `width` frames. Holds all frames of its source in memory.";

    fn plan(&self, _: f64) -> corsmal_dsp::Result<Feature> {
        let params = DeltaParams { width: self.width, order: self.order, mode: self.mode };
        at_most("width", self.width, MAX_WIDTH)?;
        delta_weights(&params)?;
        Ok(Feature {
            kernel: Kernel::Derived(self.of.clone(), params),
            raw_rows: 0,
            labels: Vec::new(),
            complex: false,
            finish: None,
        })
    }
}
