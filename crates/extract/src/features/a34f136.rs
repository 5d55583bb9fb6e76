//! `a34f136`: pyAudioAnalysis statistics of a recording (M5's random forests).

use corsmal_dsp::corsmal::M5A34f136;
use corsmal_dsp::corsmal::paa::{Peak, short_names};
use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use crate::params::Keys;

/// Parameters of `a34f136`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct A34f136 {
    peak: Peak,
}

impl Default for A34f136 {
    fn default() -> Self {
        Self { peak: Peak::Raw }
    }
}

impl WholeKernel for M5A34f136 {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let vector = self.run(ArrayView2::from_shape((1, y.len()), y).expect("one row"))?;
        Ok(vector.mapv(|x| x as f32).insert_axis(Axis(1)))
    }
}

impl FeatureKind for A34f136 {
    const KIND: &'static str = "a34f136";
    const ABOUT: &'static str = "The 34 pyAudioAnalysis features of 50 ms frames and their deltas, \
        mean and deviation over each second, mean over the seconds: one vector per channel. A \
        recording is divided by its peak, taken before centring as M5's pyAudioAnalysis did (peak = \
        raw) or after it as version 0.3.14 does (centred). Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[&[(
        "peak",
        "What a recording is divided by: raw (its peak before centring) or centred (its peak \
         after it).",
    )]];
    const PYTHON: &'static str = "corsmal.a34f136";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let short = short_names();
        let names = || short.iter().cloned().chain(short.iter().map(|n| format!("delta_{n}")));
        let labels = ["mean", "std"].iter().flat_map(|s| names().map(move |n| format!("{n}_{s}")));
        Ok(Feature::whole(Extent::Vector, M5A34f136::with_peak(sr, self.peak)?, labels.collect()))
    }

    /// There is nothing to refuse but low rates.
    fn check(&self) -> corsmal_dsp::Result<()> {
        Ok(())
    }
}
