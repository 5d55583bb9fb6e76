//! `m6_spectrogram`: the input of M6 (ACC).

use corsmal_dsp::corsmal::{M6Crop, M6Spectrogram as Plan};
use corsmal_dsp::librosa::LibrosaVersion;
use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::pixels;
use crate::params::{Keys, LIBROSA};

/// Parameters of `m6_spectrogram`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct M6Spectrogram {
    librosa: LibrosaVersion,
    begin: Begin,
}

/// Where the ten seconds begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Begin {
    /// At the second detected onset (the released code).
    #[default]
    Onset,
    /// At the start of what is taken of the recording (the paper's crop by annotations).
    Start,
}

impl Default for M6Spectrogram {
    fn default() -> Self {
        Self { librosa: Plan::default().librosa, begin: Begin::default() }
    }
}

struct Image(Plan, f64);

impl WholeKernel for Image {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let y = ArrayView2::from_shape((1, y.len()), y).expect("one row");
        let image = self.0.run(y, self.1)?;
        Ok(Array2::from_shape_vec((image.len(), 1), image.iter().copied().collect())
            .expect("one column"))
    }
}

impl FeatureKind for M6Spectrogram {
    const KIND: &'static str = "m6_spectrogram";
    const ABOUT: &'static str = "Decibel spectrogram of ten seconds at 22,050 Hz from the second \
        detected onset (or the start) on, peak-normalised, as an image of 96 x 96, row by row from 0 Hz (M6's \
        input; resamples by itself). Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[
        LIBROSA,
        &[("begin", "Where the ten seconds begin: onset (at the second detected onset) or start.")],
    ];
    const PYTHON: &'static str = "corsmal.m6_spectrogram";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let crop = match self.begin {
            Begin::Onset => M6Crop::Onset,
            Begin::Start => M6Crop::At(0.0),
        };
        let plan = Plan { librosa: self.librosa, crop };
        Ok(Feature::whole(Extent::Vector, Image(plan, sr), pixels()))
    }
}
