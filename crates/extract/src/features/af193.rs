//! `af193`: the feature vector of the CORSMAL audio baseline.

use corsmal_dsp::af193::{Af193 as Vector, names};
use ndarray::{Array1, Array2, Axis};
use serde::{Deserialize, Serialize};

use super::{Extent, Feature, FeatureKind, WholeKernel};

/// `af193` has no parameters.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Af193 {}

impl WholeKernel for Vector {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        Ok(Array1::from_vec(self.compute(y)?.to_vec()).insert_axis(Axis(1)))
    }
}

impl FeatureKind for Af193 {
    const KIND: &'static str = "af193";
    const ABOUT: &'static str = "193 means over frames: 40 MFCC, 12 chroma, 128 mel powers, 7 \
        spectral contrast, 6 tonnetz of the harmonic part (librosa 0.11's defaults). One vector a \
        channel; holds the whole recording in memory.";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        Ok(Feature::whole(Extent::Vector, Vector::new(sr)?, names()))
    }

    /// There is nothing to refuse, and its tables are not cheap.
    fn check(&self) -> corsmal_dsp::Result<()> {
        Ok(())
    }
}
