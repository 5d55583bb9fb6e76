//! `tonnetz`: tonal centroids.

use corsmal_dsp::hpss::{HarmonicPart, Work};
use corsmal_dsp::tonnetz::{DIMENSIONS, tonnetz};
use ndarray::{Array2, Axis};
use serde::{Deserialize, Serialize};

use super::chroma_cqt::{ChromaCqt, ChromaOfChannel};
use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::indices;
use crate::params::Keys;

/// Parameters of `tonnetz`: those of the chroma behind it.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Tonnetz {
    #[serde(flatten)]
    chroma: ChromaCqt,
    /// Of the harmonic part of the sound, as the baseline's vector has it.
    harmonic: bool,
}

struct Centroids {
    chroma: ChromaOfChannel,
    harmonic: Option<HarmonicPart>,
}

impl WholeKernel for Centroids {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let chroma = match &self.harmonic {
            Some(harmonic) => {
                let mut part = Vec::new();
                harmonic.of(y, &mut part, &mut Work::default(), |_| {})?;
                self.chroma.channel(&part)?
            }
            None => self.chroma.channel(y)?,
        };
        let centroids = tonnetz(chroma.view().insert_axis(Axis(0)))?;
        Ok(centroids.index_axis_move(Axis(0), 0).mapv(|x| x as f32))
    }
}

impl FeatureKind for Tonnetz {
    const KIND: &'static str = "tonnetz";
    const ABOUT: &'static str = "Six tonal centroids (fifths, minor and major thirds) of the \
                                 constant-Q chroma (librosa.feature.tonnetz); with harmonic = \
                                 true, those of the harmonic part of the \
                                 sound. Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[
        ChromaCqt::KEYS[0],
        ChromaCqt::KEYS[1],
        &[("harmonic", "true: of the harmonic part of the sound; false: of the sound as it is.")],
    ];
    const PYTHON: &'static str = "feature.tonnetz";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let extent = Extent::Frames(self.chroma.hop_length() as f64);
        let harmonic = self.harmonic.then(|| HarmonicPart::new(self.chroma.librosa()));
        let kernel = Centroids { chroma: self.chroma.kernel(sr)?, harmonic: harmonic.transpose()? };
        Ok(Feature::whole(extent, kernel, indices(DIMENSIONS)))
    }

    fn check(&self) -> corsmal_dsp::Result<()> {
        self.chroma.check()
    }
}
