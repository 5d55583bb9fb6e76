//! `chroma_cqt`: energy in pitch classes of a constant-Q transform.

use std::sync::Arc;

use corsmal_dsp::ByTuning;
use corsmal_dsp::cqt::{ChromaCqt as Fold, ChromaCqtParams, CqtParams, CqtPlan, SignalTuning};
use corsmal_dsp::librosa::LibrosaVersion;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::chroma_stft::{MAX_CHROMA, check_tuning};
use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::indices;
use crate::params::{AutoOr, Keys, LIBROSA, at_most};

/// More lie in no range of hearing.
const MAX_OCTAVES: usize = 16;

/// Parameters of `chroma_cqt`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct ChromaCqt {
    hop_length: usize,
    n_chroma: usize,
    n_octaves: usize,
    bins_per_octave: usize,
    /// In fractions of a bin; `auto` estimates it from the channel, as librosa does.
    tuning: AutoOr,
    librosa: LibrosaVersion,
}

impl Default for ChromaCqt {
    fn default() -> Self {
        Self {
            hop_length: 512,
            n_chroma: 12,
            n_octaves: 7,
            bins_per_octave: 36,
            tuning: AutoOr::Auto,
            librosa: LibrosaVersion::default(),
        }
    }
}

/// Chroma of whole channels.
pub struct ChromaOfChannel {
    params: CqtParams,
    /// Where the tuning is not given.
    tuning: Option<SignalTuning>,
    transforms: ByTuning<CqtPlan>,
    fold: Fold,
}

impl ChromaOfChannel {
    fn transform(&self, tuning: f64) -> corsmal_dsp::Result<Arc<CqtPlan>> {
        self.transforms.get(tuning, || CqtPlan::new(&CqtParams { tuning, ..self.params.clone() }))
    }
}

impl WholeKernel for ChromaOfChannel {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let tuning = match &self.tuning {
            None => self.params.tuning,
            Some(signal) => signal.estimate([y], self.params.bins_per_octave)?.unwrap_or(0.0),
        };
        self.fold.of_signal(&*self.transform(tuning)?, y)
    }
}

impl ChromaCqt {
    /// The kernel for signals of `sr` Hz.
    pub fn kernel(&self, sr: f64) -> corsmal_dsp::Result<ChromaOfChannel> {
        check_tuning(self.tuning)?;
        at_most("n_chroma", self.n_chroma, MAX_CHROMA)?;
        at_most("n_octaves", self.n_octaves, MAX_OCTAVES)?;
        at_most("bins_per_octave", self.bins_per_octave, MAX_CHROMA)?;
        let (tuning, estimated) = match self.tuning {
            AutoOr::Value(tuning) => (tuning, None),
            AutoOr::Auto => (0.0, Some(SignalTuning::padded(sr, self.librosa.pad_mode())?)),
        };
        let params = CqtParams {
            hop_length: self.hop_length,
            n_bins: self.bins_per_octave.saturating_mul(self.n_octaves),
            bins_per_octave: self.bins_per_octave,
            tuning,
            ..CqtParams::new(sr)
        };
        let fold = ChromaCqtParams {
            bins_per_octave: self.bins_per_octave,
            n_chroma: self.n_chroma,
            ..ChromaCqtParams::default()
        };
        let kernel = ChromaOfChannel {
            fold: Fold::new(params.n_bins, &fold)?,
            params: params.of(self.librosa),
            tuning: estimated,
            transforms: ByTuning::default(),
        };
        kernel.transform(tuning)?;
        Ok(kernel)
    }

    /// The librosa whose conventions are followed.
    pub fn librosa(&self) -> LibrosaVersion {
        self.librosa
    }

    /// Samples between frames.
    pub fn hop_length(&self) -> usize {
        self.hop_length
    }
}

impl FeatureKind for ChromaCqt {
    const KIND: &'static str = "chroma_cqt";
    const ABOUT: &'static str = "Magnitude of a constant-Q transform in n_chroma pitch classes \
                                 from C on, each frame divided by its maximum \
                                 (librosa.feature.chroma_cqt), with the tuning of the channel or \
                                 a given one. Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[
        LIBROSA,
        &[
            ("hop_length", "Samples from one frame to the next."),
            ("n_chroma", "Number of pitch classes."),
            ("n_octaves", "Octaves of the constant-Q transform, from C1 on."),
            ("bins_per_octave", "Bins of the constant-Q transform per octave."),
            (
                "tuning",
                "Deviation from A = 440 Hz in fractions of a bin; \"auto\": estimated from each channel.",
            ),
        ],
    ];
    const PYTHON: &'static str = "feature.chroma_cqt";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let extent = Extent::Frames(self.hop_length as f64);
        Ok(Feature::whole(extent, self.kernel(sr)?, indices(self.n_chroma)))
    }

    /// Made for a common rate: the transform costs milliseconds, and more at higher ones.
    fn check(&self) -> corsmal_dsp::Result<()> {
        self.kernel(44_100.0).map(drop)
    }
}
