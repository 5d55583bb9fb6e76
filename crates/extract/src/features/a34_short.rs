//! `a34_short`: pyAudioAnalysis' features frame by frame.

use corsmal_dsp::DspError;
use corsmal_dsp::corsmal::paa::{PaaPlan, short_names};
use ndarray::{Array1, Array2};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;

use crate::params::{Keys, USUAL_RATE};

/// Parameters of `a34_short`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct A34Short {
    /// Length of a frame in seconds.
    window: f64,
    /// Seconds between frames.
    step: f64,
    /// The differences of successive frames as well.
    deltas: bool,
}

impl Default for A34Short {
    fn default() -> Self {
        Self { window: 0.05, step: 0.05, deltas: false }
    }
}

struct Frames {
    plan: PaaPlan,
    deltas: bool,
}

impl WholeKernel for Frames {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        // As counts of a 16-bit file, which pyAudioAnalysis reads.
        let counts: Array1<f64> = y.iter().map(|x| f64::from(*x) * 32768.0).collect();
        Ok(self.plan.short_term(counts.view(), self.deltas)?.mapv(|x| x as f32))
    }
}

impl FeatureKind for A34Short {
    const KIND: &'static str = "a34_short";
    const ABOUT: &'static str = "The 34 pyAudioAnalysis features of frames of window seconds \
                                 every step seconds; deltas = true adds their differences from \
                                 frame to frame, 68 in all. The recording is first centred and \
                                 divided by its peak, so it is held whole in memory.";
    const KEYS: &'static [Keys] = &[&[
        ("window", "Length of a frame in seconds."),
        ("step", "Seconds from the start of one frame to the next."),
        ("deltas", "true: also the differences from frame to frame, 68 values in all."),
    ]];
    const PYTHON: &'static str = "corsmal.a34_short";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let samples = |name, seconds: f64| {
            let samples = (seconds * sr).round_ties_even();
            if (1.0..=1e7).contains(&samples) {
                return Ok(samples as usize);
            }
            Err(DspError::parameter(name, seconds, "a time in seconds of 1 to 10000000 samples"))
        };
        let (window, step) = (samples("window", self.window)?, samples("step", self.step)?);
        let mut labels = short_names();
        if self.deltas {
            labels.extend(short_names().iter().map(|name| format!("delta_{name}")));
        }
        let kernel = Frames { plan: PaaPlan::new(sr, window, step)?, deltas: self.deltas };
        Ok(Feature::whole(Extent::Frames(step as f64), kernel, labels))
    }

    /// Made for a common rate: the filters do not exist at every one.
    fn check(&self) -> corsmal_dsp::Result<()> {
        self.plan(USUAL_RATE).map(drop)
    }
}
