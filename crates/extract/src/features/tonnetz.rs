//! `tonnetz`: tonal centroids.

use corsmal_dsp::tonnetz::{DIMENSIONS, tonnetz};
use ndarray::{Array2, Axis};
use serde::{Deserialize, Serialize};

use super::chroma_cqt::{ChromaCqt, ChromaOfChannel};
use super::{Extent, Feature, FeatureKind, WholeKernel, indices};

/// Parameters of `tonnetz`: those of the chroma behind it.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Tonnetz {
    #[serde(flatten)]
    chroma: ChromaCqt,
}

struct Centroids(ChromaOfChannel);

impl WholeKernel for Centroids {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let chroma = self.0.channel(y)?;
        let centroids = tonnetz(chroma.view().insert_axis(Axis(0)))?;
        Ok(centroids.index_axis_move(Axis(0), 0).mapv(|x| x as f32))
    }
}

impl FeatureKind for Tonnetz {
    const KIND: &'static str = "tonnetz";
    const ABOUT: &'static str = "Six tonal centroids (fifths, minor and major thirds) of the \
        constant-Q chroma (librosa.feature.tonnetz). Holds the whole recording in memory.";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let extent = Extent::Frames(self.chroma.hop_length() as f64);
        Ok(Feature::whole(extent, Centroids(self.chroma.kernel(sr)?), indices(DIMENSIONS)))
    }

    fn check(&self) -> corsmal_dsp::Result<()> {
        self.chroma.check()
    }
}
