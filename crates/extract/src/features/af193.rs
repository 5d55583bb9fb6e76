//! `af193`: the feature vector of the CORSMAL audio baseline.

use corsmal_dsp::corsmal::af193::{Af193 as Vector, names};
use corsmal_dsp::librosa::LibrosaVersion;
use ndarray::{Array1, Array2, Axis};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use crate::params::{Keys, LIBROSA};

/// Parameters of `af193`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Af193 {
    librosa: LibrosaVersion,
}

impl WholeKernel for Vector {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        Ok(Array1::from_vec(self.compute(y)?.to_vec()).insert_axis(Axis(1)))
    }

    fn bytes_per_sample(&self) -> u64 {
        20
    }
}

impl FeatureKind for Af193 {
    const KIND: &'static str = "af193";
    const ABOUT: &'static str = "193 means over frames: 40 MFCC, 12 chroma, 128 mel powers, 7 \
        spectral contrast, 6 tonnetz of the harmonic part (defaults of librosa 0.11, or of 0.8). \
        One vector per channel; holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[LIBROSA];
    const PYTHON: &'static str = "corsmal.af193";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        Ok(Feature::whole(Extent::Vector, Vector::of(sr, self.librosa)?, names()))
    }

    /// There is nothing to refuse, and its tables are not cheap.
    fn check(&self) -> corsmal_dsp::Result<()> {
        Ok(())
    }
}
